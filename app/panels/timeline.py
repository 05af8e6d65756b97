"""A slider over every recorded moment, and a strip that shows what happened at each."""

import time
from collections.abc import Callable

import numpy as np
import viser
from viser._messages import GuiSliderMark

from app.cell_images import data_uri
from app.history import StepHistory
from app.html import STYLE, button, icon, text
from app.panels.html_panel import HtmlPanel
from app.run_state import RunState
from app.view import View

SETTLE = 0.5  # s: after the user moved the slider it is not moved back by states that are on their way


class Timeline:
    """Moves the run to any moment; ticks where levels begin. The strip is as wide as the window and can be clicked."""

    def __init__(
        self,
        gui: viser.GuiApi,
        on_jump: Callable[[object], None],
        jump: Callable[[str], str],
        around: dict[str, str],
    ) -> None:
        self._jump, self._around = jump, around
        self._slider = gui.add_slider("Moment", min=0, max=1, step=1, initial_value=0)
        self._strip = HtmlPanel(gui)
        self._moved = 0.0
        self._marks: tuple[GuiSliderMark, ...] = ()
        self._history = StepHistory()

        @self._slider.on_update
        def _(event: viser.GuiEvent) -> None:
            if event.client is not None:
                self._moved = time.monotonic()
                on_jump(self._slider.value)

    def show(self, state: RunState, view: View) -> None:
        last = max(1, state.length)
        if self._slider.max != last:
            self._slider.max = last
        self._slider.disabled = state.length == 0
        if time.monotonic() - self._moved > SETTLE and self._slider.value != state.moment:
            self._slider.value = state.moment
        marks = level_marks(state)
        if marks != self._marks:
            self._marks = marks
            self._slider._marks = marks
        self._history.update(state)
        self._strip.set(STYLE + self._picture(state, view))

    def _picture(self, state: RunState, view: View) -> str:
        selected = "" if view.selected is None else f" of vertex {view.selected}"
        enabled = view.selected is not None and state.length > 0
        before = button(
            "",
            self._around["before"],
            hint=f"Previous move{selected} (;)",
            icon=icon("one", mirrored=True),
            enabled=enabled,
        )
        after = button("", self._around["after"], hint=f"Next move{selected} (')", icon=icon("one"), enabled=enabled)
        if state.length == 0:
            strip = "<div class='strip'></div>"
        else:
            cursor = 100 * state.moment / state.length
            press = (
                "var r=this.getBoundingClientRect();"
                f"var m=Math.max(1,Math.min({state.length},Math.ceil((event.clientX-r.left)/r.width*{state.length})));"
                + self._jump("m")
            )
            strip = (
                f"<div class='strip' role='img' aria-label='What happened' onpointerdown=\"{text(press)}\" "
                f"title='Brighter green: the energy fell more. Violet: rejected steps. White: moved by hand. Click to go there.'>"
                f"<img src='{data_uri(self._history.picture())}' alt=''>"
                f"<i style='left:{cursor:.2f}%'></i></div>"
            )
        return f"<div class='row'>{before}{after}{strip}</div>"


def level_marks(state: RunState) -> tuple[GuiSliderMark, ...]:
    """A tick where each level begins."""
    levels = np.array([record.position.level for record in state.trace.steps[: state.length]])
    begins = np.flatnonzero(np.diff(levels, prepend=-1)) if len(levels) else []
    return tuple(GuiSliderMark(float(moment), f"level {levels[moment] + 1}") for moment in begins)
