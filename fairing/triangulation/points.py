"""Selection of sparse points: outliers are removed, and points close to each other become one."""

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
        pixel: (n,) float, world units: the median over them of what a pixel covers at the point; NaN without photos.
        seen_by: (V, n) bool: photos that see a point.
        left_out: (n,) object: "vertex", the reason why a point is not a vertex, or "" while undecided.
    """

    n_photos: np.ndarray
    error: np.ndarray
    pixel: np.ndarray
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
    size = np.full((len(views), n), np.nan)
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
        size[v, ids] = np.where(depth > 0, depth, np.nan) / view.camera.K[0, 0]
    n_photos = seen_by.sum(axis=0)
    error = np.where(behind, np.inf, np.sqrt(squared / np.maximum(n_photos, 1)))
    pixel = np.full(n, np.nan)
    known = np.isfinite(size).any(axis=0)
    pixel[known] = np.nanmedian(size[:, known], axis=0)
    facts = PointFacts(n_photos, error, pixel, seen_by, np.full(n, "", dtype=object))
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


def merge_close(positions: np.ndarray, strength: np.ndarray, reach: np.ndarray) -> np.ndarray:
    """Merge each point into a stronger one nearby.

    Args:
        positions: (n, 3) float, world units.
        strength: (n,) float: priority; ties go to the lower index.
        reach: (n,) float, world units: distance up to which a point takes others in.

    Returns:
        (n,) int: for each point the one it is merged into; itself if it remains.
    """
    near = KDTree(positions).query_ball_point(positions, reach)
    keeper = np.full(len(positions), -1)
    for i in np.argsort(-strength, kind="stable").tolist():
        if keeper[i] < 0:
            others = np.array(near[i])
            keeper[others[keeper[others] < 0]] = i
            keeper[i] = i
    return keeper
