"""Scan sampling: the points of a registered scan that become vertices, at bends, at ends and sparsely in between.

The paper samples range data "at points of high curvature and discontinuity"; fairing then moves the vertices onto the real
corners, which the rays of the scan missed.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from fairing.errors import InputError
from fairing.scene import SparsePoints, View

NEIGHBOURS = 24
MAX_POINTS = 200_000  # larger scans are subsampled evenly to this many
GAP = np.radians(120.0)  # a point with such an angle free of neighbours lies at an end of the surface
BENT = 0.01  # surface variation (0 to 1/3) above which a surface bends: two planes at 25 degrees
FILL = 2.5  # spacings between points where nothing bends or ends
SPLAT = 0.35  # fraction of the spacing: radius around a point of the scan that occludes
BEHIND = 2.0  # spacings: a point less far behind its occluder is visible, for surfaces at up to 80 degrees


@dataclass(frozen=True, eq=False)
class CriticalPoints:
    """Chosen points of a scan, the most critical first.

    Attributes:
        positions: (k, 3) float, in the scan's unit.
        variation: (k,) float: surface variation, 0 in a plane to 1/3.
        is_end: (k,) bool: points where the surface ends.
    """

    positions: np.ndarray
    variation: np.ndarray
    is_end: np.ndarray


def critical_points(points: np.ndarray, spacing: float) -> CriticalPoints:
    """Points of a scan (n, 3) float at least `spacing` apart where it bends or ends, and 2.5 times that elsewhere.

    Raises:
        InputError: fewer than 50 points.
    """
    if len(points) < 50:
        raise InputError(f"scan: expected at least 50 points, found {len(points)}")
    points = np.asarray(points, dtype=np.float64)[:: max(1, -(-len(points) // MAX_POINTS))]
    variation, is_end = _shape(points)
    # Ends come before bends, because the variation is meaningless where a surface ends.
    order = np.lexsort((np.arange(len(points)), -np.round(variation, 12), ~is_end))  # in a plane it is rounding error
    is_critical = is_end | (variation > BENT)
    tree = KDTree(points)
    is_free = np.ones(len(points), dtype=bool)
    chosen: list[int] = []
    for radius, candidates in ((spacing, order[is_critical[order]]), (FILL * spacing, order[~is_critical[order]])):
        if radius > spacing:  # keep the wider distance to the points chosen before, too
            for point in chosen:
                is_free[tree.query_ball_point(points[point], radius)] = False
        for point in candidates.tolist():
            if is_free[point]:
                chosen.append(point)
                is_free[tree.query_ball_point(points[point], radius)] = False
    return CriticalPoints(points[chosen], variation[chosen], is_end[chosen])


def _shape(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Surface variation (n,) float (Pauly, Gross, Kobbelt 2002), and whether the surface ends at a point (n,) bool."""
    neighbours = np.asarray(KDTree(points).query(points, k=min(NEIGHBOURS, len(points)))[1])
    variation, is_end = np.empty(len(points)), np.empty(len(points), dtype=bool)
    for block in np.array_split(np.arange(len(points)), max(1, len(points) // 20_000)):
        around = points[neighbours[block]]
        centred = around - around.mean(axis=1, keepdims=True)
        values, vectors = np.linalg.eigh(np.einsum("nki,nkj->nij", centred, centred))
        variation[block] = np.clip(values[:, 0], 0, None) / np.maximum(values.sum(axis=1), 1e-300)
        arms = around[:, 1:] - points[block][:, None]
        x, y = (np.einsum("nki,ni->nk", arms, vectors[:, :, axis]) for axis in (2, 1))
        angles = np.sort(np.arctan2(y, x), axis=1)
        gaps = np.diff(angles, axis=1, append=angles[:, :1] + 2 * np.pi)
        is_end[block] = gaps.max(axis=1) > GAP
    return variation, is_end


def seen_points(scan: np.ndarray, chosen: np.ndarray, views: Sequence[View], spacing: float) -> SparsePoints:
    """Chosen points of a registered scan as sparse points, with the photos that see them.

    A photo sees a point that projects into it and does not lie behind the discs that the points of the scan occlude.

    Args:
        scan: (n, 3) float, world units.
        chosen: (k, 3) float, world units.
        views: V views.
        spacing: distance of the chosen points, world units.
    """
    observations, pixels = [], []
    for v, view in enumerate(views):
        camera = view.camera
        uv, depth = camera.project(chosen)
        inside = (depth > 0) & (uv >= 0).all(axis=1) & (uv <= (camera.width - 1, camera.height - 1)).all(axis=1)
        scan_uv, scan_depth = camera.project(scan)
        front = scan_depth > 0
        ids = np.flatnonzero(inside)
        if len(ids) == 0 or not front.any():
            continue
        tree = KDTree(scan_uv[front])
        reach = SPLAT * spacing * camera.K[0, 0] / depth[ids]
        for i, near in zip(ids, tree.query_ball_point(uv[ids], reach), strict=True):
            nearest = scan_depth[front][near].min(initial=np.inf)
            if depth[i] <= nearest + BEHIND * spacing:
                observations.append((i, v))
                pixels.append(uv[i])
    colors = np.full((len(chosen), 3), 200, dtype=np.uint8)
    return SparsePoints(
        chosen, colors, np.array(observations, dtype=np.int64).reshape(-1, 2), np.array(pixels).reshape(-1, 2)
    )
