"""Scales of plots: what lies where, with zeros on a log scale and values that do not differ."""

import numpy as np
import pytest

from app.panels.plot_drawing import value_scale


def test_zeros_lie_below_the_smallest_positive_value_of_a_log_scale_at_a_mark_of_their_own():
    scale = value_scale(np.array([0.0, 0.001, 0.1]), is_log=True)
    zero, smallest, largest = scale.heights(np.array([0.0, 0.001, 0.1]))
    assert zero == 0.0
    assert zero < 0.1 < smallest < largest < 1.0
    assert scale.marks[0] == 0.0
    assert scale.marks[1:] == pytest.approx([0.001, 0.01, 0.1])


def test_a_log_scale_of_positive_values_has_no_mark_for_zero():
    scale = value_scale(np.array([0.5, 20.0]), is_log=True)
    assert scale.marks.min() > 0
    assert np.isclose(np.diff(scale.heights(np.array([1.0, 10.0, 100.0])), 2), 0.0)


@pytest.mark.parametrize("values", [[0.0], [0.0, 0.0], [3.0, 3.0], [-2.0, 5.0]])
@pytest.mark.parametrize("is_log", [False, True])
def test_any_values_lie_within_the_plot(values: list[float], is_log: bool):
    heights = value_scale(np.array(values), is_log).heights(np.array(values))
    assert ((heights >= 0) & (heights <= 1)).all()
