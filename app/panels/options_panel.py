"""Options panel: the options of the run as widgets, generated from the fields of their dataclasses."""

from typing import Any

import viser

from app.debugger.commands import Branch, Restart
from app.debugger.controller import Controller
from app.debugger.option_fields import OptionField, changed_options, differing_fields, option_fields
from app.debugger.run_state import RunState
from app.html import button, text
from app.page_state.page_state import PageState
from app.viser_bridge.html_events import HtmlEvents, press
from app.viser_bridge.html_panel import HtmlPanel
from app.viser_bridge.synced_widget import on_user_change
from fairing.errors import InputError
from fairing.option_check import check_options
from fairing.options import PRESETS, FairingOptions

FROM_WIDGETS = "Custom"
MAX_DETAILS = 6  # changed options with an explanation each; a preset changes dozens


class OptionsPanel:
    """Changes take effect with one of two buttons: from the current moment on, or in a new run."""

    def __init__(
        self,
        gui: viser.GuiApi,
        html_events: HtmlEvents,
        controller: Controller,
    ) -> None:
        self._controller = controller
        self._events = html_events.named({"go_on": press(self._go_on), "start_over": press(self._start_over)})
        options = controller.state.options
        self._shown = options
        self._head = HtmlPanel(gui)
        self._preset = gui.add_dropdown("Preset", (FROM_WIDGETS, *PRESETS), hint="Fills in all fields below.")
        on_user_change(self._preset, html_events.guarded(self._take_preset))
        self._widgets: list[tuple[OptionField, Any]] = []
        groups: dict[str, list[OptionField]] = {}
        for field in option_fields():
            groups.setdefault(field.group, []).append(field)
        for name, members in groups.items():
            with gui.add_folder(name.capitalize(), expand_by_default=False):
                for field in members:
                    widget = _widget(gui, field, options)
                    on_user_change(widget, lambda _: controller.republish())
                    self._widgets.append((field, widget))
        self._presets = {name: [f.shown(preset) for f, _ in self._widgets] for name, preset in PRESETS.items()}

    def show(self, state: RunState, page_state: PageState) -> None:
        if state.options is not self._shown:
            before, self._shown = self._shown, state.options
            self._fill_in(state.options, before)
        preset = self._preset_of_widgets()
        if self._preset.value != preset:
            self._preset.value = preset
        try:
            typed = self._read(state.options)
            changed = differing_fields(state.options, typed)
            note = text(f"Changed: {', '.join(field.label for field in changed)}" if changed else "No changes.")
            details = "".join(_change(field, typed, state.options) for field in changed[:MAX_DETAILS])
        except InputError as error:
            note, details = text(error), ""
        go_on = button(
            "Continue from here", self._events("go_on"), css_class="grow",
            hint="Continue from here (keeps the steps so far and changes the options)",
        )  # fmt: skip
        over = button(
            "Start over", self._events("start_over"), hint="Start over (a new run with these options)", css_class="grow"
        )
        self._head.set(f"<div class='row'>{go_on}{over}</div><div class='note dim'>{note}</div>{details}")

    def _preset_of_widgets(self) -> str:
        """The preset that the fields have the values of."""
        values = [widget.value for _, widget in self._widgets]
        return next((name for name, shown in self._presets.items() if shown == values), FROM_WIDGETS)

    def _read(self, options: FairingOptions) -> FairingOptions:
        return changed_options(options, {field.path: field.read(widget.value) for field, widget in self._widgets})

    def _typed(self) -> FairingOptions:
        options = self._read(self._controller.state.options)
        check_options(options)
        return options

    def _go_on(self) -> None:
        options, state = self._typed(), self._controller.state
        is_other_schedule = any(field.group == "schedule" for field in differing_fields(state.options, options))
        if is_other_schedule and state.moment > 0:
            raise InputError("the schedule cannot change within a run; use Start over")
        self._controller.post(Branch(options))

    def _start_over(self) -> None:
        self._controller.post(Restart(self._typed()))

    def _take_preset(self, value: object) -> None:
        name = str(value)
        if name in PRESETS:
            self._fill_in(PRESETS[name])
            self._controller.republish()

    def _fill_in(self, options: FairingOptions, unless_as_in: FairingOptions | None = None) -> None:
        for field, widget in self._widgets:
            value = field.shown(options)
            # An option that has not changed in the run keeps its widget, where the user may be typing.
            if widget.value != value and (unless_as_in is None or field.shown(unless_as_in) != value):
                widget.value = value


def _change(field: OptionField, typed: FairingOptions, options: FairingOptions) -> str:
    """What was changed, from what to what, what it means and when it takes effect."""
    return (
        f"<div class='breakpoint'><b>{text(field.label)}</b> <code>{text(field.shown(options))}</code> → "
        f"<code>{text(field.shown(typed))}</code><div class='dim'>{text(field.meaning)}</div><div>{text(field.effect)}</div></div>"
    )


def _widget(gui: viser.GuiApi, field: OptionField, options: FairingOptions) -> Any:
    value, hint = field.shown(options), f"{field.meaning} {field.effect}".strip()
    if field.kind == "choice":
        return gui.add_dropdown(field.label, field.choices, initial_value=value, hint=hint)
    if field.kind == "switch":
        return gui.add_checkbox(field.label, value, hint=hint)
    if field.kind == "list":
        return gui.add_text(field.label, value, hint=hint)
    if field.kind == "whole":
        return gui.add_number(field.label, value, step=1, hint=hint)
    return gui.add_number(field.label, float(value), step=10 ** -_decimals(float(value)), hint=hint)


def _decimals(value: float) -> int:
    """Decimals of the widget's step: 100 changes by 1, 0.7 by 0.1, 0.002 by 0.001."""
    digits = f"{value:.12f}".rstrip("0")
    return min(9, len(digits.split(".")[1])) if value != 0 else 1
