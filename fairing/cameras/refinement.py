"""Refinement of the cameras of photos: points are found, poses adjusted, points found anew and poses adjusted again."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import count
from typing import Any

import numpy as np

from fairing.camera import Camera
from fairing.cameras.adjustment import Deviations, residual_lengths
from fairing.cameras.corrected_scene import facts_of_lens, recorded_lens, triangulated_again, views_with
from fairing.cameras.estimation import MOST_STEPS, estimate_poses
from fairing.cameras.judge import FEWEST_POINTS, HELD_OUT, CameraJudgement, is_held_out, judge_cameras
from fairing.cameras.lens_trial import STEPS as TRIAL_STEPS
from fairing.cameras.lens_trial import lens_note
from fairing.cameras.misfits import misfits_of, photo_medians
from fairing.cameras.observed_points import ObservedPoints
from fairing.cameras.pose_model import PoseModel
from fairing.errors import Cancelled, InputError
from fairing.features.find import find_keypoints, find_points
from fairing.features.options import FeatureOptions
from fairing.features.points import FeaturePoints
from fairing.lens import Lens
from fairing.photo import has_given_lens
from fairing.scene import SparsePoints, View

FIRST_SEARCH = FeatureOptions(epipolar_distance=6.0, residual=6.0)
"""Of the search with the given cameras: its limits are wide, because wrong cameras move points off their epipolar lines."""
WIDE_SEARCH = FeatureOptions(epipolar_distance=24.0, residual=24.0)
"""Made where a photo shows fewer points than `FEW` of the median photo: its camera may be wrong by more than the first limits."""
FEW = 0.3
SECOND_SEARCH = FeatureOptions()
LARGE_CORRECTION = 3.0  # px: given cameras that are kept do not fit if the adjustment moves them farther
FIRST_KEYPOINTS, SECOND_KEYPOINTS = 4000, 8000
"""Of a photo, the strongest ones, which the searches use (ledger: keypoints of refinement)."""

Progress = Callable[[float, str], None]
"""Called with the finished part, 0 to 1, and a line."""


@dataclass(frozen=True, eq=False)
class Iteration:
    """One state of an adjustment: the camera v has the rotation exp([turns_v]x) R_v and the centre c_v + shifts_v, R_v and c_v
    those of the given camera.

    Attributes:
        turns: (v, 3) float, radians.
        shifts: (v, 3) float, world units.
        errors: (v,) float, px: median reprojection error in each photo; 0 where it shows no point.
    """

    turns: np.ndarray
    shifts: np.ndarray
    errors: np.ndarray


@dataclass(frozen=True, eq=False)
class Refinement:
    """What refinement found.

    Attributes:
        names: of the photos.
        taken: whether the corrected cameras are used.
        reason: why, or why not, as one sentence.
        cameras: the corrected cameras, one a photo, also where they are not taken.
        lenses: the radial distortion that was found in each photo, which `cameras` are without; None where there is none.
        corrections: (v,) float, px: median displacement of the images of points in each photo; 0 where a photo shows none.
        judgement: held-out points with both sets of cameras; None without points.
        sigma: estimated standard deviations, px; None without points.
        iterations: of the adjustments, in their order; the first is the given state.
        found: the points that a run would find in the photos, if they were asked for.
        lens_note: a sentence if the photos look distorted, see `lens_trial`; else "".
    """

    names: tuple[str, ...]
    taken: bool
    reason: str
    cameras: tuple[Camera, ...]
    corrections: np.ndarray
    judgement: CameraJudgement | None = None
    sigma: Deviations | None = None
    iterations: tuple[Iteration, ...] = ()
    found: FeaturePoints | None = None
    lenses: tuple[Lens | None, ...] = ()
    lens_note: str = ""

    @property
    def errors(self) -> tuple[np.ndarray, np.ndarray]:
        """(v,) float each, px: median reprojection error of each photo with the given and with the corrected cameras."""
        if not self.iterations:
            return np.zeros(len(self.corrections)), np.zeros(len(self.corrections))
        return self.iterations[0].errors, self.iterations[-1].errors

    @property
    def misfits(self) -> np.ndarray:
        """(v,) bool: photos whose camera does not fit: also after the adjustment, or kept although that would move it far."""
        moves_far = self.corrections > LARGE_CORRECTION
        return misfits_of(self.errors[1]) | (moves_far & (not self.taken))

    def corrected_views(self, views: Sequence[View]) -> tuple[View, ...]:
        """The photos with the corrected cameras, undistorted; as they were if these are not taken."""
        return views_with(views, self.cameras, self.lenses) if self.taken else tuple(views)

    def corrected_points(self, points: SparsePoints | None) -> SparsePoints | None:
        """The points triangulated again with the corrected cameras; as they were if these are not taken."""
        return points if points is None or not self.taken else triangulated_again(points, self.cameras, self.lenses)

    @classmethod
    def of_facts(
        cls, facts: dict[str, Any], cameras: Sequence[Camera], iterations: Sequence[Iteration]
    ) -> "Refinement":
        """From what `facts` returned, and the corrected cameras."""
        held_out, sigma = facts["held_out"], facts["sigma_px"]
        return cls(
            tuple(photo["name"] for photo in facts["photos"]),
            facts["taken"],
            facts["reason"],
            tuple(cameras),
            np.array([photo["correction_px"] for photo in facts["photos"]]),
            None if held_out is None else CameraJudgement(**held_out),
            None if sigma is None else Deviations(**sigma),
            tuple(iterations),
            lenses=tuple(
                recorded_lens(photo["lens"], camera) for photo, camera in zip(facts["photos"], cameras, strict=True)
            ),
            lens_note=facts["lens_note"],
        )

    def facts(self) -> dict[str, Any]:
        """The refinement for a report in JSON."""
        return {
            "taken": self.taken,
            "reason": self.reason,
            "lens_note": self.lens_note,
            "held_out": None if self.judgement is None else vars(self.judgement),
            "sigma_px": None if self.sigma is None else vars(self.sigma),
            "photos": [
                {
                    "name": name,
                    "correction_px": correction,
                    "error_before_px": before,
                    "error_after_px": after,
                    "lens": facts_of_lens(lens),
                }
                for name, correction, before, after, lens in zip(
                    self.names,
                    self.corrections.tolist(),
                    *(errors.tolist() for errors in self.errors),
                    self.lenses or (None,) * len(self.names),
                    strict=True,
                )
            ],
        }


def refine(
    views: Sequence[View],
    threads: int = 0,
    on_progress: Progress = lambda fraction, line: None,
    cancel_requested: Callable[[], bool] = lambda: False,
    finds_points: bool = False,
    adjusts_lens: bool = False,
) -> Refinement:
    """Correct the poses of cameras, and keep the correction where held-out points are clearly better with it.

    The frame is held by the given poses: a mesh stays where it is.

    Args:
        threads: 0 for one a core.
        cancel_requested: polled several times a second while points are found, and after each step of an adjustment.
        finds_points: also find the points that a run would find in the photos, from the same keypoints.
        adjusts_lens: correct focal lengths, principal points and, in photos without a given distortion, two coefficients of
            radial distortion, too; photos with the same given intrinsics share them.

    Raises:
        InputError: a photo or mask cannot be decoded.
        Cancelled: `cancel_requested` returned True.
    """
    work = _Work(on_progress, cancel_requested)
    search = _Search(views, finds_points, threads, work)
    result = _refined(views, search, work, adjusts_lens)
    if not finds_points or (result.taken and any(result.lenses)):
        return result  # a run finds points in the undistorted photos, whose keypoints are others
    cameras = [view.camera for view in result.corrected_views(views)]
    return replace(result, found=search.points(cameras, SECOND_SEARCH))


def _refined(views: Sequence[View], search: "_Search", work: "_Work", adjusts_lens: bool) -> Refinement:
    names, given = tuple(view.name for view in views), [view.camera for view in views]
    found = _first_points(search, given)
    held_out = found.chosen(is_held_out(len(found))) if len(found) else found
    if len(held_out) < FEWEST_POINTS:
        reason = (
            f"the photos show {len(found)} points, too few to judge cameras by ({FEWEST_POINTS * HELD_OUT} are needed)"
        )
        return Refinement(names, False, reason, tuple(given), np.zeros(len(given)))
    training = found.chosen(~is_held_out(len(found)))
    model = PoseModel.of(given, training, adjusts_lens, [_is_bent(view) for view in views])
    adjusting = _Adjusting(model, training, work)
    estimate = estimate_poses(model, training, on_step=adjusting.show)
    lenses = _lenses(model, estimate.poses, given)
    if lenses is None:
        return Refinement(
            names, False, "cameras as given: adjusted lenses fold a photo", tuple(given), np.zeros(len(given))
        )
    judgement = judge_cameras(model, model.given, estimate.poses, held_out, estimate.sigma.observation)
    if judgement.is_clear:
        cameras = model.cameras_at(estimate.poses, given)
        again = ObservedPoints.of_features(search.points(cameras, SECOND_SEARCH, SECOND_KEYPOINTS, lenses))
        again = again.distorted(lenses)
        again = again.chosen(~again.shares_observation(held_out)) if len(again) else again
        if len(again) >= len(training) // 2:
            further = _Adjusting(model, again, work, estimate.poses)
            second = estimate_poses(estimate.model, again, estimate.poses, further.show)
            judgement_then = judge_cameras(model, model.given, second.poses, held_out, second.sigma.observation)
            lenses_then = _lenses(model, second.poses, given)
            if lenses_then is not None and judgement_then.loss_after <= judgement.loss_after:
                estimate, judgement, training, lenses = second, judgement_then, again, lenses_then
                adjusting.iterations += further.iterations
    note = ""
    if not adjusts_lens and model.bending.any():
        step = work.steps(TRIAL_STEPS, "trial of a distortion")
        note = lens_note(estimate, training, held_out, lambda *_: step(""))
    corrections = _corrections(model, estimate.poses, training)
    before, after = judgement.error_before, judgement.error_after
    compared = (
        f"held-out points in the photos {before:.2f} px from their observations, {after:.2f} px with corrected cameras"
    )
    if judgement.is_clear:
        reason = f"cameras corrected by {np.median(corrections):.2f} px (at most {corrections.max():.2f}): {compared}"
    else:
        reason = f"cameras as given: {compared}, which is no clear improvement"
    return Refinement(
        names, judgement.is_clear, reason, tuple(model.cameras_at(estimate.poses, given)), corrections, judgement,
        estimate.sigma, tuple(adjusting.iterations),
        lenses=tuple(lens if lens.is_distorted else None for lens in lenses), lens_note=note,
    )  # fmt: skip


class _Work:
    """Progress and cancellation of a refinement: 0.3 of the work finds keypoints, 0.1 is each search and adjustment."""

    def __init__(self, progress: Progress, cancel_requested: Callable[[], bool]) -> None:
        self._progress, self._begun = progress, 0.0
        self.cancel_requested = cancel_requested

    def share(self, share: float) -> Callable[[float, str], None]:
        """A callback for the next part of the work, (finished part of it, line)."""
        begun, self._begun = self._begun, self._begun + share
        return lambda part, line: self._progress(begun + share * min(part, 1.0), f"refining cameras: {line}")

    def steps(self, most: int, what: str) -> Callable[[str], None]:
        """A callback for each of at most `most` steps of the next part of the work, with what is added to its line.

        It raises Cancelled if that was requested.
        """
        show, numbers = self.share(0.1), count(1)

        def step(found: str) -> None:
            number = next(numbers)
            show(number / most, f"{what}, step {number}{found}")
            if self.cancel_requested():
                raise Cancelled

        return step


class _Search:
    """Finds points with different cameras, keypoints once.

    Args:
        all_needed: whether `points` will be called without a limit of keypoints.
    """

    def __init__(self, views: Sequence[View], all_needed: bool, threads: int, work: _Work) -> None:
        self._views, self._threads, self._work = views, threads, work
        show, most = work.share(0.3), 0 if all_needed else SECOND_KEYPOINTS
        self._keypoints = find_keypoints(
            views, SECOND_SEARCH, threads, lambda done, count: show(done / count, f"keypoints of {len(views)} photos"),
            work.cancel_requested, most,
        )  # fmt: skip

    def points(
        self, cameras: Sequence[Camera], options: FeatureOptions, most: int = 0, lenses: Sequence[Lens] = ()
    ) -> FeaturePoints:
        """Points at the strongest `most` keypoints of each photo; with 0, the points that a run would find.

        Args:
            lenses: of the photos, from which the keypoints are freed; empty: they are pinholes.
        """
        keypoints = [found.strongest(most) for found in self._keypoints] if most else self._keypoints
        if lenses:
            keypoints = [found.undistorted(lens) for found, lens in zip(keypoints, lenses, strict=True)]
        views = views_with(self._views, cameras)
        show = self._work.share(0.1)
        return find_points(
            views, options, self._threads, lambda done, count: show(done / count, "matching photos"),
            self._work.cancel_requested, keypoints,
        )  # fmt: skip


class _Adjusting:
    """Keeps the iterations of an adjustment, shows its progress and ends it on request.

    Args:
        start: (v, n) float, px: first poses; default: the given ones, which are kept as the first iteration.
    """

    def __init__(
        self, model: PoseModel, observed: ObservedPoints, work: _Work, start: np.ndarray | None = None
    ) -> None:
        self._model, self._step = model, work.steps(MOST_STEPS, "adjustment")
        self.iterations: list[Iteration] = []
        if start is None:
            self._keep(model.given, observed)

    def show(self, poses: np.ndarray, observed: ObservedPoints) -> None:
        """Called after each step, see `OnStep`."""
        self._keep(poses, observed)
        self._step(f", reprojection error {np.median(self.iterations[-1].errors):.2f} px")

    def _keep(self, poses: np.ndarray, observed: ObservedPoints) -> None:
        errors = photo_medians(residual_lengths(self._model, poses, observed), observed.photo, len(poses))
        turns, shifts = self._model.displacements(poses)
        self.iterations.append(Iteration(turns, shifts, errors))


def _first_points(search: _Search, given: Sequence[Camera]) -> ObservedPoints:
    """Points found with the given cameras."""
    found = ObservedPoints.of_features(search.points(given, FIRST_SEARCH, FIRST_KEYPOINTS))
    counts = np.bincount(found.photo, minlength=len(given))
    if counts.min() >= FEW * np.median(counts):
        return found
    wider = ObservedPoints.of_features(search.points(given, WIDE_SEARCH, FIRST_KEYPOINTS))
    is_more = np.bincount(wider.photo, minlength=len(given)) > counts
    return wider if is_more[counts < FEW * np.median(counts)].any() else found


def _is_bent(view: View) -> bool:
    """Whether a distortion may be found in a photo: none is given, and the photo has its principal point (others are cut out)."""
    camera = view.camera
    return not has_given_lens(view.photo) and bool(
        (camera.K[:2, 2] > 0).all() and (camera.K[:2, 2] < (camera.width - 1, camera.height - 1)).all()
    )


def _lenses(model: PoseModel, poses: np.ndarray, given: Sequence[Camera]) -> list[Lens] | None:
    """The lenses at parameters (v, n), px; None if one folds its photo over itself."""
    try:
        return model.lenses_at(poses, given)
    except InputError:
        return None


def _corrections(model: PoseModel, poses: np.ndarray, observed: ObservedPoints) -> np.ndarray:
    """(v,) float, px: see `Refinement.corrections`."""
    before, after = (model.project(at, observed)[0] for at in (model.given, poses))
    return photo_medians(np.linalg.norm(after - before, axis=1), observed.photo, len(model))
