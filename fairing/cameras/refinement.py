"""Refinement of the cameras of a scene: points are found, poses adjusted, points found anew and poses adjusted again."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fairing.camera import Camera
from fairing.cameras.adjustment import Deviations
from fairing.cameras.corrected_scene import triangulated_again, with_cameras
from fairing.cameras.estimation import Estimate, estimate_poses
from fairing.cameras.judge import FEWEST_POINTS, HELD_OUT, CameraJudgement, is_held_out, judge_cameras
from fairing.cameras.observed_points import ObservedPoints
from fairing.cameras.pose_model import PoseModel
from fairing.features.find import find_keypoints, find_points
from fairing.features.options import FeatureOptions
from fairing.features.points import FeaturePoints
from fairing.scene import Scene, View

FIRST_SEARCH = FeatureOptions(epipolar_distance=6.0, residual=6.0)
"""Of the search with the given cameras: its limits are wide, because wrong cameras move points off their epipolar lines."""
SECOND_SEARCH = FeatureOptions()
FIRST_KEYPOINTS, SECOND_KEYPOINTS = 4000, 8000
"""Of a photo, the strongest ones, which the searches use (ledger: keypoints of refinement)."""

Progress = Callable[[float, str], None]
"""Called with the finished part, 0 to 1, and a line."""


@dataclass(frozen=True, eq=False)
class Refinement:
    """What refinement found.

    Attributes:
        scene: with the corrected cameras and with points moved accordingly; the scene as it was if they are not taken.
        taken: whether the corrected cameras are used.
        reason: why, or why not, as one sentence.
        cameras: the corrected cameras, one a photo, also where they are not taken.
        corrections: (v,) float, px: median displacement of the images of points in each photo; 0 where a photo shows none.
        judgement: held-out points with both sets of cameras; None without points.
        sigma: estimated standard deviations, px; None without points.
    """

    scene: Scene
    taken: bool
    reason: str
    cameras: tuple[Camera, ...]
    corrections: np.ndarray
    judgement: CameraJudgement | None = None
    sigma: Deviations | None = None

    def facts(self) -> dict[str, Any]:
        """The refinement for a report in JSON."""
        return {
            "taken": self.taken,
            "reason": self.reason,
            "held_out": None if self.judgement is None else vars(self.judgement),
            "sigma_px": None if self.sigma is None else vars(self.sigma),
            "photos": [
                {"name": view.name, "correction_px": correction}
                for view, correction in zip(self.scene.views, self.corrections.tolist(), strict=True)
            ],
        }


def refine(
    scene: Scene,
    threads: int = 0,
    on_progress: Progress = lambda fraction, line: None,
    cancel_requested: Callable[[], bool] = lambda: False,
) -> Refinement:
    """Correct the poses of a scene's cameras, and keep the correction where held-out points are clearly better with it.

    The mesh stays as it is: the frame is held by the given poses. Points of the choice "own" are found anew in the photos;
    other sparse points with observations are triangulated again. Intrinsics are kept.

    Args:
        threads: 0 for one a core.
        cancel_requested: polled several times a second while points are found.

    Raises:
        InputError: a photo or mask cannot be decoded.
        Cancelled: `cancel_requested` returned True.
    """
    is_own = scene.points_choice == "own" or (scene.sparse_points is not None and scene.sparse_points.origin == "own")
    search = _Search(scene.views, is_own, threads, on_progress, cancel_requested)
    given = [view.camera for view in scene.views]
    found = ObservedPoints.of_features(search.points(given, FIRST_SEARCH, FIRST_KEYPOINTS))
    held_out = found.chosen(is_held_out(len(found))) if len(found) else found
    if len(held_out) < FEWEST_POINTS:
        reason = (
            f"the photos show {len(found)} points, too few to judge cameras by ({FEWEST_POINTS * HELD_OUT} are needed)"
        )
        return Refinement(scene, False, reason, tuple(given), np.zeros(len(given)))
    training = found.chosen(~is_held_out(len(found)))
    model = PoseModel.of(given, training)
    estimate = estimate_poses(model, training)
    cameras, judgement = _judged(model, estimate, given, held_out)
    if judgement.is_clear:
        again = ObservedPoints.of_features(search.points(cameras, SECOND_SEARCH, SECOND_KEYPOINTS))
        again = again.chosen(~again.shares_observation(held_out)) if len(again) else again
        if len(again) >= len(training) // 2:
            second = estimate_poses(model, again, estimate.poses)
            cameras_then, judgement_then = _judged(model, second, given, held_out)
            if judgement_then.loss_after <= judgement.loss_after:
                estimate, cameras, judgement, training = second, cameras_then, judgement_then, again
    corrections = _corrections(given, cameras, training)
    before, after = judgement.error_before, judgement.error_after
    compared = (
        f"held-out points in the photos {before:.2f} px from their observations, {after:.2f} px with corrected cameras"
    )
    if not judgement.is_clear:
        reason = f"cameras as given: {compared}, which is no clear improvement"
        return Refinement(scene, False, reason, tuple(cameras), corrections, judgement, estimate.sigma)
    reason = f"cameras corrected by {np.median(corrections):.2f} px (at most {corrections.max():.2f}): {compared}"
    return Refinement(
        _corrected(scene, cameras, search, is_own), True, reason, tuple(cameras), corrections, judgement, estimate.sigma
    )


class _Search:
    """Finds points with different cameras, keypoints once: 0.55 of the work, and 0.15 for each of at most three searches.

    Args:
        all_needed: whether `points` will be called without a limit of keypoints.
    """

    def __init__(
        self,
        views: Sequence[View],
        all_needed: bool,
        threads: int,
        progress: Progress,
        cancel_requested: Callable[[], bool],
    ) -> None:
        self._views, self._threads, self._progress, self._cancelled = views, threads, progress, cancel_requested
        self._done = 0.0
        show, most = self._share(0.55, "keypoints"), 0 if all_needed else SECOND_KEYPOINTS
        self._keypoints = find_keypoints(views, SECOND_SEARCH, threads, show, cancel_requested, most)

    def points(self, cameras: Sequence[Camera], options: FeatureOptions, most: int = 0) -> FeaturePoints:
        """Points at the strongest `most` keypoints of each photo; with 0, the points that a run would find."""
        keypoints = [found.strongest(most) for found in self._keypoints] if most else self._keypoints
        views = [replace(view, camera=camera) for view, camera in zip(self._views, cameras, strict=True)]
        show = self._share(0.15, "matching photos")
        return find_points(views, options, self._threads, show, self._cancelled, keypoints)

    def _share(self, share: float, line: str) -> Callable[[int, int], None]:
        begun, self._done = self._done, self._done + share

        def show(done: int, count: int) -> None:
            self._progress(begun + share * done / max(count, 1), f"refining cameras: {line}")

        return show


def _judged(
    model: PoseModel, estimate: Estimate, given: Sequence[Camera], held_out: ObservedPoints
) -> tuple[list[Camera], CameraJudgement]:
    cameras = model.cameras_at(estimate.poses, given)
    return cameras, judge_cameras(given, cameras, held_out, estimate.sigma.observation)


def _corrections(given: Sequence[Camera], cameras: Sequence[Camera], observed: ObservedPoints) -> np.ndarray:
    """(v,) float, px: see `Refinement.corrections`."""
    result = np.zeros(len(given))
    for v, (before, after) in enumerate(zip(given, cameras, strict=True)):
        points = observed.positions[observed.point[observed.photo == v]]
        if len(points):
            moved = after.project(points)[0] - before.project(points)[0]
            result[v] = np.median(np.linalg.norm(moved, axis=1))
    return result


def _corrected(scene: Scene, cameras: Sequence[Camera], search: _Search, is_own: bool) -> Scene:
    """The scene with other cameras, and the sparse points as `refine` describes."""
    corrected, points = with_cameras(scene, cameras), scene.sparse_points
    if is_own:
        # From the keypoints at hand: detection takes most of a search's time.
        found = search.points(cameras, SECOND_SEARCH)
        if len(found):
            line = f"{len(found)} points were found in the photos with corrected cameras"
            warnings = (*scene.warnings, line)
            return replace(corrected, sparse_points=found.sparse_points(), points_choice="own", warnings=warnings)
    if points is None or points.origin == "given":
        return corrected
    return replace(corrected, sparse_points=triangulated_again(points, cameras))
