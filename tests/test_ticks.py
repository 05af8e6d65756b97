"""Labels of an axis fit beside it and tell its ticks apart."""

import numpy as np
import pytest

from app.ticks import log_ticks, tick_labels, ticks

UNITS = {"k": 1e3, "M": 1e6, "G": 1e9}


def read(label: str) -> float:
    """The number a label stands for."""
    figure, _, unit = label.replace("\u2212", "-").partition("\u2009")
    return float(figure + unit) if unit not in UNITS else float(figure) * UNITS[unit]


@pytest.mark.parametrize(
    ("low", "high"),
    [
        *((0, 0.003), (2, 7), (14.418, 14.431), (9994.2, 9996.1), (9000, 62_000), (0, 150_000)),
        *((3_905_000, 3_943_000), (8e8, 2.1e9), (-4e6, 4e6)),
    ],
)
def test_labels_are_short_and_stand_for_their_ticks(low, high):
    values = ticks(low, high)
    labels = tick_labels(values)
    assert max(map(len, labels)) <= 7
    assert len(set(labels)) == len(values) >= 2
    assert [read(label) for label in labels] == pytest.approx(values.tolist(), rel=1e-3, abs=1e-12)


@pytest.mark.parametrize("high", [3, 5, 8])
def test_labels_of_powers_of_ten_are_short_and_stand_for_them(high):
    values = log_ticks(1, high)
    labels = tick_labels(values)
    assert max(map(len, labels)) <= 7
    assert [read(label) for label in labels] == pytest.approx(values.tolist())


@pytest.mark.parametrize(
    ("lowest", "highest", "expected"),
    [(0.03, 0.8, [0.05, 0.1, 0.2, 0.5]), (0.9, 7, [1, 2, 5]), (3, 30, [5, 10, 20]), (0.01, 10, [0.01, 0.1, 1, 10])],
)
def test_a_log_scale_of_less_than_two_powers_has_marks_all_along_it(lowest, highest, expected):
    assert log_ticks(np.log10(lowest), np.log10(highest)) == pytest.approx(expected)
    close = log_ticks(np.log10(2.1), np.log10(4.9))
    assert len(close) >= 2
    assert (np.diff(close) > 0).all()
    assert 2.1 <= close[0] <= close[-1] <= 4.9
