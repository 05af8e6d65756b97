"""Triangles of strips and fans."""

import numpy as np


def strip_triangles(corners: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """(m, 3) int: the triangles of strips, every second one turned over so that all face one way.

    Triangles that use a vertex twice only join strips and are left out.

    Args:
        corners: (c,) int: vertices of all strips, one after the other; -1 ends a strip within an item.
        lengths: (s,) int: number of corners of each item.
    """
    starts = np.zeros(len(corners) + 1, dtype=bool)
    starts[np.cumsum(lengths) - lengths] = True
    starts[1:] |= corners == -1  # the next strip begins after the mark
    starts = starts[:-1]
    first = np.maximum.accumulate(np.where(starts, np.arange(len(corners)), 0))
    place = np.arange(len(corners)) - first
    ends = np.flatnonzero((place >= 2) & (corners != -1))
    triangles = np.stack([corners[ends - 2], corners[ends - 1], corners[ends]], axis=1)
    is_odd = (place[ends] - 2) % 2 == 1
    triangles[is_odd] = triangles[is_odd][:, [1, 0, 2]]
    a, b, c = triangles.T
    return triangles[(a != b) & (b != c) & (c != a)]


def fan_triangles(corners: np.ndarray) -> np.ndarray:
    """(m, 3) int: the triangles of a fan around its first corner."""
    if len(corners) < 3:
        return np.empty((0, 3), dtype=corners.dtype)
    first = np.full(len(corners) - 2, corners[0])
    triangles = np.column_stack([first, corners[1:-1], corners[2:]])
    a, b, c = triangles.T
    return triangles[(a != b) & (b != c) & (c != a)]
