"""The list of breakpoints, and how to make one."""

from collections.abc import Callable
from dataclasses import replace

import viser

from app.debugger.breakpoints import Breakpoint, Breakpoints
from app.debugger.controller import Controller
from app.debugger.quantities import FUNCTIONS, VALUES, limits_of
from app.debugger.run_state import RunState
from app.html import button, icon, text
from app.page_state.page_state import PageState
from app.viser_bridge.html_events import Bridge, whole_number
from app.viser_bridge.html_panel import HtmlPanel
from app.viser_bridge.text_field import Line
from fairing.errors import InputError

READY_MADE: dict[str, str] = {
    "A step is rejected": "rejected > 0",
    "The energy is stuck": "abs(percent) < 0.01",
    "A vertex is under-determined": "weakest < 0.01",
    "A step is longer than 2 px": "step_px > 2",
    "A photo sees other faces": "seen_changes > 0",
    "A level begins": "sweep == 1 and unit == 1 and iteration == 1",
}


def ready_made(page_state: PageState) -> dict[str, str]:
    """Conditions by what they say: those that always fit, and those about what is selected and looked through."""
    about = {}
    if page_state.selected is not None:
        about |= {
            f"Vertex {page_state.selected} moves 1 px from here": f"travelled({page_state.selected}) > 1",
            f"A step is about vertex {page_state.selected}": f"about({page_state.selected})",
        }
    if page_state.entered is not None:
        about |= {
            f"The energy rises in view {page_state.entered}": f"view({page_state.entered}) > 0",
            f"PageState {page_state.entered} has 30 % outliers": f"outliers({page_state.entered}) > 0.3",
        }
    return about | READY_MADE


class BreakpointsPanel:
    """Conditions are typed or taken ready-made; each can be switched off, made to report only, or removed."""

    def __init__(
        self,
        gui: viser.GuiApi,
        controller: Controller,
        bridge: Bridge,
        press: "BreakpointButtons",
    ) -> None:
        self._controller, self._press = controller, press
        self._mistake = ""
        hint = "A condition over what is recorded of a step, such as rejected > 0. Enter adds it."
        self._line = Line(gui, bridge, "Stop when", hint, self._add)
        self._panel = HtmlPanel(gui)
        press.on_add = lambda: self._add(self._line.take_draft())

    def show(self, state: RunState, page_state: PageState) -> None:
        rows = "".join(self._row(item) for item in state.breakpoints)
        ready = "".join(
            button(name, self._press.ready_made(str(k)), hint=f"Stop when {condition}", css_class="layer")
            for k, (name, condition) in enumerate(ready_made(page_state).items())
        )
        words = "".join(
            f"<tr><th>{text(name)}</th><td>{text(meaning)}</td></tr>"
            for name, meaning in [*VALUES.items(), *((f"{name}( )", meaning) for name, meaning in FUNCTIONS.items())]
        )
        log = "".join(f"<div class='dim'>{text(line)}</div>" for line in state.log[-8:])
        add = button("Add", self._press.add, hint="Add this breakpoint (Enter)", css_class="grow")
        self._panel.set(
            f"<div class='row'>{add}</div>{_pointed_at(self._mistake)}"
            f"<div class='note'>{rows or '<span class=dim>No breakpoints yet.</span>'}</div>"
            + (f"<h4>Reported</h4>{log}" if log else "")
            + f"<h4>Ready-made</h4><div class='stack'>{ready}</div><h4>Words of a condition</h4>"
            f"<table class='words'>{words}</table>"
        )

    def _row(self, item: Breakpoint) -> str:
        number = str(item.number)
        state = "on" if item.enabled else "off"
        switch = button(
            "●", self._press.switch(number), hint=f"Breakpoint {number} is {state}", css_class=f"dot {state}"
        )
        report = button(
            "report" if item.logs else "stop",
            self._press.report(number),
            hint="Stop, or only report",
            css_class="small",
        )
        remove = button("", self._press.remove(number), hint="Remove", icon=icon("leave"), css_class="small")
        return (
            f"<div class='row breakpoint'>{switch}<code class='grow'>{text(item.condition.text)}</code>"
            f"<span class='dim'>{item.hits} ×</span>{report}{remove}</div>"
        )

    def _add(self, written: str) -> None:
        limits = limits_of(self._controller.scene)
        try:
            self._controller.edit_breakpoints(lambda all_of_them: all_of_them.added(written, limits))
        except InputError as error:
            self._mistake = str(error)
            self._line.write(written)
            self._controller.republish()
        else:
            self._mistake = ""


def _pointed_at(mistake: str) -> str:
    """A mistake, and below it what was written with a mark at the place."""
    said, _, written = mistake.partition(" (at: ")
    before, _, after = written.removesuffix(")").partition("⟨here⟩")
    place = f"<code>{text(before)}<b class='rejected'>▸</b>{text(after)}</code>" if written else ""
    return f"<div class='note rejected' role='alert'>{text(said)}</div>{place}" if mistake else ""


class BreakpointButtons:
    """JavaScript for the panel's buttons; made where they stay on the page when the panel is not."""

    def __init__(
        self,
        controller: Controller,
        view: PageState,
        bridge: Bridge,
    ) -> None:
        self.on_add: Callable[[], None] = lambda: None
        self.add = bridge.button(lambda: self.on_add())

        def edit(change: Callable[[Breakpoints, int], Breakpoints]) -> Callable[[object], None]:
            def act(number: object) -> None:
                if isinstance(number, int | float) and number == number and abs(number) < 1e9:
                    controller.edit_breakpoints(lambda all_of_them: change(all_of_them, int(number)))

            return act

        self.switch = bridge.number(
            edit(lambda b, n: b.changed(n, lambda item: replace(item, enabled=not item.enabled)))
        )
        self.report = bridge.number(edit(lambda b, n: b.changed(n, lambda item: replace(item, logs=not item.logs))))
        self.remove = bridge.number(edit(lambda b, n: b.removed(n)))

        def add_ready_made(number: object) -> None:
            conditions = list(ready_made(view).values())
            chosen = conditions[whole_number(number, 0, len(conditions) - 1, "condition")]
            controller.edit_breakpoints(lambda all_of_them: all_of_them.added(chosen))

        self.ready_made = bridge.number(add_ready_made)
