"""Debug bar: the buttons that run, pause, step forward and step back."""

from collections.abc import Callable

import viser

from app.debugger.actions import ACTIONS, BLOCK_NAMES, KEY_LABELS
from app.debugger.run_state import RunState
from app.html import button, icon
from app.page_state.page_state import PageState
from app.page_state.run_controls import RunControls
from app.viser_bridge.html_events import HtmlEvents, press
from app.viser_bridge.html_panel import HtmlPanel

INTO = "Shift+I"
CANCEL = "Cancel (P, Space): drop the step in progress; steps that are done stay recorded"


class DebugBar:
    """Run controls, a row of forward steps and a row of backward steps, from one iteration to a whole level."""

    def __init__(
        self,
        gui: viser.GuiApi,
        html_events: HtmlEvents,
        run_controls: RunControls,
        step_into: Callable[[], None],
        switch_layout: Callable[[], None],
    ) -> None:
        self._panel = HtmlPanel(gui)
        self._order = "sequential"
        self._events = html_events.named({a.name: press(run_controls.poster(a.command)) for a in ACTIONS})
        self._into = button("", html_events.button(step_into), hint=f"{KEY_LABELS[INTO]} ({INTO})", icon=icon("into"))
        self._leave = button(
            "Leave presenter layout",
            html_events.button(switch_layout),
            hint="Leave presenter layout (Shift+P)",
            css_class="small wide",
        )
        self._actions = {action.name: action for action in ACTIONS}

    def show(self, state: RunState, page_state: PageState) -> None:
        self._order = state.options.schedule.order
        unit = BLOCK_NAMES.get(self._order, "vertex")
        forward, back = not state.finished, state.moment > 0
        if state.is_moving:
            main = self._button("pause", "Pause", css_class="main grow", key=True)
        elif state.is_working:
            main = self._button("pause", "Cancel", css_class="main grow", key=True, hint=CANCEL)
        else:
            main = self._button("run", "Run", css_class="main grow", key=True, enabled=forward)
        top = (
            f'<div class="row" style="margin-bottom:8px">{self._button("start", enabled=back)}'
            f"{self._button('run_back', enabled=back)}{main}{self._into}"
            f"{self._button('end', enabled=state.moment < state.length)}"
            f"{self._button('restart', enabled=state.length > 0)}</div>"
        )
        heads = "".join(f"<span>{name}</span>" for name in ("iteration", unit, "sweep", "stage", "level"))
        names = ("iteration", "unit", "sweep", "stage", "level")
        forwards = "".join(self._button(name, enabled=forward) for name in names)
        backs = "".join(self._button(f"back_{name}", enabled=back) for name in names)
        grid = (
            f'<div class="grid"><span></span>{heads}<span class="left">Forward</span>{forwards}'
            f'<span class="left">Back</span>{backs}</div>'
        )
        leave = f"<div style='margin-top:8px'>{self._leave}</div>" if page_state.is_presenting else ""
        self._panel.set(f"<div class='pinned'>{top}{grid}{leave}</div>")

    def _button(
        self,
        name: str,
        label: str = "",
        *,
        css_class: str = "",
        key: bool = False,
        enabled: bool = True,
        hint: str = "",
    ) -> str:
        action = self._actions[name]
        shape = icon(action.icon, mirrored=action.mirrored)
        if key:
            shape += f"<kbd>{action.keys[0][0]}</kbd>"
        press, hint = self._events(name), hint or action.hint_in(self._order)
        return button(label, press, hint=hint, icon=shape, css_class=css_class, enabled=enabled)
