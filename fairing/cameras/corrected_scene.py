"""A scene with corrected cameras: its views, and its sparse points where the corrected cameras see them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fairing.camera import Camera
from fairing.cameras.adjustment import triangulate
from fairing.cameras.observed_points import ObservedPoints
from fairing.cameras.pose_model import PoseModel
from fairing.optimize.loss import GemanMcClure
from fairing.scene import Scene, SparsePoints, View

LOSS_SCALE = 3.0  # px: observations of other programs have deviations of about 1 px
STEPS = 10


def with_cameras(scene: Scene, cameras: Sequence[Camera]) -> Scene:
    """The scene with corrected cameras. Its given sparse points are triangulated again, others stay where they are."""
    views, points = views_with(scene.views, cameras), scene.sparse_points
    if points is not None and points.origin == "given":
        points = triangulated_again(points, cameras)
    given = scene.given_cameras or tuple(view.camera for view in scene.views)
    return replace(scene, views=views, sparse_points=points, cameras_choice="given", given_cameras=given)


def views_with(views: Sequence[View], cameras: Sequence[Camera]) -> tuple[View, ...]:
    """The photos with other cameras."""
    return tuple(replace(view, camera=camera) for view, camera in zip(views, cameras, strict=True))


def triangulated_again(points: SparsePoints, cameras: Sequence[Camera]) -> SparsePoints:
    """The points at the positions that their observations give with other cameras; without two observations as they were."""
    order = np.lexsort((points.observations[:, 1], points.observations[:, 0]))
    point, photo = points.observations[order].T
    observed = ObservedPoints(points.positions, point, photo, points.pixels[order])
    is_used = np.bincount(point, minlength=len(observed)) >= 2
    if not is_used.any():
        return points
    chosen = observed.chosen(is_used)
    model = PoseModel.of(cameras, chosen)
    positions = points.positions.copy()
    positions[is_used] = triangulate(model, model.given, chosen, GemanMcClure(LOSS_SCALE), STEPS)
    return replace(points, positions=positions)
