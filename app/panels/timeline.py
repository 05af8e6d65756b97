"""A slider over every recorded moment."""

import time
from collections.abc import Callable

import numpy as np
import viser
from viser._messages import GuiSliderMark

from app.controller import RunState
from app.view import View

SETTLE = 0.5  # s: after the user moved the slider it is not moved back by states that are on their way


class Timeline:
    """Moves the run to any moment; ticks where levels begin."""

    def __init__(self, gui: viser.GuiApi, on_jump: Callable[[object], None]) -> None:
        self._slider = gui.add_slider("Moment", min=0, max=1, step=1, initial_value=0)
        self._moved = 0.0
        self._marks: tuple[GuiSliderMark, ...] = ()

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


def level_marks(state: RunState) -> tuple[GuiSliderMark, ...]:
    """A tick where each level begins."""
    levels = np.array([record.position.level for record in state.trace.steps[: state.length]])
    begins = np.flatnonzero(np.diff(levels, prepend=-1)) if len(levels) else []
    return tuple(GuiSliderMark(float(moment), f"level {levels[moment] + 1}") for moment in begins)
