"""Lines of a plot over moments, and the runs of equal values that divide them."""

from typing import NamedTuple

import numpy as np


class Line(NamedTuple):
    """One line of a plot, whose values can be compared: moments and values (n,)."""

    moments: np.ndarray
    values: np.ndarray


def begins(values: np.ndarray) -> np.ndarray:
    """Indices at which runs of equal values (n,) begin."""
    return np.flatnonzero(np.diff(values, prepend=values[:1] - 1))


def intervals(values: np.ndarray) -> list[tuple[int, int]]:
    """First index and end of every run of equal values (n,)."""
    first = begins(values).tolist()
    return list(zip(first, [*first, len(values)][1:], strict=True))
