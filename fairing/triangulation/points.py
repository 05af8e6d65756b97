"""Selection of sparse points: outliers are removed, and a well-spread subset is chosen."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import KDTree

from fairing.errors import InputError
from fairing.scene import SparsePoints, View
from fairing.triangulation.options import TriangulationOptions

LARGEST_ERROR = 4.0
"""A point is an outlier if its rms reprojection error exceeds this times the median (at least 1 px), ..."""
ISOLATED = 8.0
NEIGHBOURS = 6
"""... or if the distance to its neighbour number `NEIGHBOURS` exceeds `ISOLATED` times the median over points."""


@dataclass(frozen=True, eq=False)
class PointFacts:
    """Observations and status of n points.

    Attributes:
        n_photos: (n,) int: photos that see a point.
        error: (n,) float, px: rms reprojection error over them; infinite for a point behind one of them.
        seen_by: (V, n) bool: photos that see a point.
        left_out: (n,) object: "vertex", the reason why a point is not a vertex, or "" while undecided.
    """

    n_photos: np.ndarray
    error: np.ndarray
    seen_by: np.ndarray
    left_out: np.ndarray = field(repr=False)

    @property
    def usable(self) -> np.ndarray:
        """(n,) bool: undecided points."""
        return self.left_out == ""

    def leave_out(self, ids: np.ndarray, reason: str) -> None:
        """Leave out points, by index (k,) int, for a reason; only those that are still undecided change."""
        ids = np.asarray(ids, dtype=np.int64)
        self.left_out[ids[self.left_out[ids] == ""]] = reason


def judge_points(views: Sequence[View], points: SparsePoints, options: TriangulationOptions) -> PointFacts:
    """Count photos, measure reprojection errors, and leave out outliers and points that too few photos see.

    Raises:
        InputError: fewer than three points are left.
    """
    n = len(points.positions)
    if n < 3:
        raise InputError(f"triangulation: expected at least 3 sparse points, found {n}; give a mesh with --mesh")
    squared, seen_by = np.zeros(n), np.zeros((len(views), n), dtype=bool)
    behind = np.zeros(n, dtype=bool)
    for v, view in enumerate(views):
        rows = points.observations[:, 1] == v
        ids = points.observations[rows, 0]
        uv, depth = view.camera.project(points.positions[ids])
        behind[ids[depth <= 0]] = True
        error = ((uv - points.pixels[rows]) ** 2).sum(axis=1)
        first = np.unique(ids, return_index=True)[1]  # a photo counts once, even where it lists a point twice
        squared[ids[first]] += np.where(depth > 0, error, 0)[first]
        seen_by[v, ids] = True
    n_photos = seen_by.sum(axis=0)
    error = np.where(behind, np.inf, np.sqrt(squared / np.maximum(n_photos, 1)))
    facts = PointFacts(n_photos, error, seen_by, np.full(n, "", dtype=object))
    facts.leave_out(np.flatnonzero(n_photos < options.min_photos), f"seen by fewer than {options.min_photos} photos")
    usable = facts.usable
    if usable.any():
        limit = LARGEST_ERROR * max(float(np.median(error[usable])), 1.0)
        facts.leave_out(np.flatnonzero(~(error <= limit)), "reprojection error too large")
    ids = np.flatnonzero(facts.usable)
    if len(ids) > NEIGHBOURS:
        reach = KDTree(points.positions[ids]).query(points.positions[ids], NEIGHBOURS + 1)[0][:, -1]
        facts.leave_out(ids[reach > ISOLATED * np.median(reach)], "far from all others")
    count = int(facts.usable.sum())
    if count < 3:
        raise InputError(
            f"triangulation: expected at least 3 points that {options.min_photos} photos see well, found {count} of "
            f"{n} sparse points; give a mesh with --mesh"
        )
    return facts


def spread_out(pixels: np.ndarray, strength: np.ndarray, spacing: float, most: int | None) -> np.ndarray:
    """Greedy choice of points with a minimum distance from each other, the strongest first.

    Args:
        pixels: (n, 2) float, px.
        strength: (n,) float: priority; ties go to the lower index.
        spacing: minimum distance, px; increased if more than `most` points would remain.
        most: limit of the number of points; None: no limit.

    Returns:
        (k,) int: indices.
    """
    order = np.argsort(-strength, kind="stable")
    chosen = _greedy(pixels, order, spacing)
    if most is None or len(chosen) <= most:
        return chosen
    low, high = spacing, float(np.ptp(pixels, axis=0).max()) + 1
    best = order[:most] if most < 3 else None
    for _ in range(12):
        middle = np.sqrt(low * high)
        tried = _greedy(pixels, order, middle)
        if len(tried) <= most:
            best, high = tried, middle
        else:
            low = middle
    return best if best is not None else chosen[:most]


def _greedy(pixels: np.ndarray, order: np.ndarray, spacing: float) -> np.ndarray:
    """Take points in order, except those nearer than `spacing` to one taken before."""
    squares: dict[tuple[int, int], list[int]] = {}
    cells = np.floor(pixels / spacing).astype(np.int64).tolist()
    places = pixels.tolist()
    chosen = []
    for i in order.tolist():
        (cx, cy), (x, y) = cells[i], places[i]
        near = (j for dx in (-1, 0, 1) for dy in (-1, 0, 1) for j in squares.get((cx + dx, cy + dy), ()))
        if all((places[j][0] - x) ** 2 + (places[j][1] - y) ** 2 >= spacing**2 for j in near):
            squares.setdefault((cx, cy), []).append(i)
            chosen.append(i)
    return np.array(chosen, dtype=np.int64)
