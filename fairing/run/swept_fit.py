"""Swept fit: a robust fit of the start to the sparse points, then to the points of surface sweeps from where it ended.

After each fit the edges and faces of a building are made parallel to its axes (`fairing.geometry.manhattan`).
"""

from typing import NamedTuple

import numpy as np

from fairing.camera import Camera
from fairing.cells.level_choice import typical_footprint
from fairing.features.points import FeaturePoints
from fairing.features.robust_fit import robust_fit
from fairing.features.surface_sweep import HALF_WINDOW, SurfaceSweep, reduction
from fairing.geometry.manhattan import straightened
from fairing.geometry.pixel_size import pixel_size
from fairing.mesh import Mesh
from fairing.run.start_error import measured_start_error
from fairing.solve.problem import Problem

SWEEPS = 2  # each allows for half the error of the one before (ledger: surface sweep)
LEAST_ERROR = 3.0  # px: that a sweep allows for
# A start is far off if a fit to the sparse points moves this part of its vertices that far (ledger: surface sweep: which starts).
FAR_PART, FAR_PX = 0.25, 0.9
# px of the photos of a sweep: height of large faces; windows on smaller ones hold several (ledger: surface sweep: which starts).
LARGE_FACE = 3 * (2 * HALF_WINDOW + 1)


class SweptFit(NamedTuple):
    """Attributes:
    vertices: (n, 3) float: fitted positions, world units.
    points: of the last sweep.
    start_error: measured distance of the vertices from their true positions before the fit, px.
    """

    vertices: np.ndarray
    points: FeaturePoints
    start_error: float


def swept_fit(problem: Problem, vertices: np.ndarray) -> SweptFit:
    """The fit of vertices (n, 3), which keep their place where it would fold a face.

    `Problem.near_points` keeps the points of the last sweep. A start of small faces that the sparse points hardly move is not
    swept: it is more accurate than single pixels' depths. The fit depends on the photos, the fitting points, the locked vertices
    and `vertices` alone.

    Raises:
        Cancelled: cancellation was requested.
    """
    views, check = problem.scene.views, problem.raise_if_cancelled
    cameras, mesh = [view.camera for view in views], problem.scene.mesh.moved(vertices)

    def fitted_to(points: FeaturePoints, begin: np.ndarray | None = None) -> Mesh:
        found = robust_fit(mesh, cameras, points, problem.locked, check, begin).vertices
        return mesh.moved(straightened(found, mesh.faces, problem.locked, pixel_size(cameras, found)))

    check()
    sweep = SurfaceSweep(views, problem.evaluator.pool, check)
    points, near = problem.observed_points, FeaturePoints.none("no sweep was made")
    error, fitted = measured_start_error(problem, vertices), fitted_to(points)
    if _is_far(mesh, fitted, cameras) or _has_large_faces(problem, vertices, max(error, LEAST_ERROR)):
        with problem.work.doing("finding points near the surface", SWEEPS) as work:
            for k in work.each(range(SWEEPS)):
                near = sweep.points(fitted, max(error / 2**k, LEAST_ERROR))
                fitted = fitted_to(points.joined(near), fitted.vertices)
    problem.near_points[vertices.tobytes()] = near
    return SweptFit(problem.moved_to(vertices, fitted.vertices), near, error)


def _is_far(start: Mesh, fitted: Mesh, cameras: list[Camera]) -> bool:
    """Whether a fit moved `FAR_PART` of the vertices by `FAR_PX`, as the median photo sees them at a right angle."""
    moved = np.linalg.norm(fitted.vertices - start.vertices, axis=1) / pixel_size(cameras, start.vertices)
    return float(np.quantile(np.nan_to_num(moved), 1 - FAR_PART)) >= FAR_PX


def _has_large_faces(problem: Problem, vertices: np.ndarray, error: float) -> bool:
    """Whether most faces are large in the photos of a sweep that allows for an error, px."""
    scene = problem.scene
    shrink = float(np.median([reduction(view.camera, error) for view in scene.views]))
    return shrink * typical_footprint(scene, vertices, problem.orientation, problem.options) >= LARGE_FACE
