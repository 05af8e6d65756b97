"""A scene with corrected cameras: its views, and its sparse points where the corrected cameras see them."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fairing.camera import Camera
from fairing.cameras.adjustment import triangulate
from fairing.cameras.observed_points import ObservedPoints
from fairing.cameras.pose_model import PoseModel
from fairing.lens import Lens
from fairing.optimize.loss import GemanMcClure
from fairing.photo import UndistortedPhoto
from fairing.scene import Scene, SparsePoints, View

LOSS_SCALE = 3.0  # px: observations of other programs have deviations of about 1 px
STEPS = 10

Lenses = Sequence[Lens | None]


def with_cameras(scene: Scene, cameras: Sequence[Camera], lenses: Lenses = ()) -> Scene:
    """The scene with corrected cameras. Its given sparse points are triangulated again, others stay where they are.

    Args:
        lenses: see `views_with`.
    """
    views, points = views_with(scene.views, cameras, lenses), scene.sparse_points
    if points is not None and points.origin == "given":
        points = triangulated_again(points, cameras, lenses)
    given = scene.given_cameras or tuple(view.camera for view in scene.views)
    return replace(scene, views=views, sparse_points=points, cameras_choice="given", given_cameras=given)


def views_with(views: Sequence[View], cameras: Sequence[Camera], lenses: Lenses = ()) -> tuple[View, ...]:
    """The photos with other cameras.

    Args:
        lenses: the distortion that was found in each photo; the views show the undistorted photo. Empty: none in any.
    """
    moved = tuple(replace(view, camera=camera) for view, camera in zip(views, cameras, strict=True))
    if not lenses:
        return moved
    return tuple(view if lens is None else _undistorted(view, lens) for view, lens in zip(moved, lenses, strict=True))


def _undistorted(view: View, lens: Lens) -> View:
    mask = None if view.mask is None else view.mask.undistorted(lens)
    return replace(view, photo=UndistortedPhoto(view.photo, lens), mask=mask)


def found_lens(view: View) -> Lens | None:
    """The distortion that was found in a view's photo, see `views_with`."""
    return view.photo.lens if isinstance(view.photo, UndistortedPhoto) else None


def facts_of_lens(lens: Lens | None) -> dict[str, Any] | None:
    """A lens for a file in JSON; `recorded_lens` is the inverse."""
    return None if lens is None else {"K": lens.K.tolist(), "distortion": lens.distortion.tolist()}


def recorded_lens(facts: dict[str, Any] | None, camera: Camera) -> Lens | None:
    """The lens of the photo of a camera from what `facts_of_lens` returned.

    Raises:
        TypeError, KeyError, ValueError: they are no such facts (an `InputError` is a ValueError).
    """
    if facts is None:
        return None
    return Lens(np.array(facts["K"], float), np.array(facts["distortion"], float), camera.width, camera.height)


def triangulated_again(points: SparsePoints, cameras: Sequence[Camera], lenses: Lenses = ()) -> SparsePoints:
    """The points at the positions that their observations give with other cameras; without two observations as they were.

    Args:
        lenses: see `views_with`.
    """
    points = _with_undistorted_pixels(points, lenses)
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


def _with_undistorted_pixels(points: SparsePoints, lenses: Lenses) -> SparsePoints:
    """The points with their observations in the undistorted photos, without those that these do not show."""
    if not any(lenses):
        return points
    pixels = points.pixels.copy()
    for v, lens in enumerate(lenses):
        mine = points.observations[:, 1] == v
        if lens is not None:
            pixels[mine] = lens.undistort(pixels[mine])
    shown = np.isfinite(pixels).all(axis=1)
    return replace(points, observations=points.observations[shown], pixels=pixels[shown])
