"""Marks of a slider, changed after it was made: viser 1.1.1 ignores assignments to `slider.marks`."""

from collections.abc import Sequence

import viser
from viser._messages import GuiSliderMark


def set_slider_marks(slider: viser.GuiInputHandle, marks: Sequence[tuple[float, str | None]]) -> None:
    """Mark these values, with a label or without."""
    slider._marks = tuple(GuiSliderMark(value, label) for value, label in marks)  # pyright: ignore[reportAttributeAccessIssue]
