"""Preparation of the start: smoothing and the fit to the sparse points, each applied only if it lowers the photo loss."""

from typing import NamedTuple

import numpy as np

from fairing.cells.level_choice import first_fine_level
from fairing.features.points import FeaturePoints
from fairing.features.robust_fit import held_back_loss
from fairing.geometry.manhattan import straightened_from_afar
from fairing.geometry.normal_filter import smoothed
from fairing.geometry.pixel_size import pixel_size
from fairing.run.records import Evaluation, moved_record
from fairing.run.swept_fit import swept_fit
from fairing.run_plan import RunPlan
from fairing.solve.energy import fixed_sigma, robust_scale, robust_sigma
from fairing.solve.face_loss import loss_of_faces
from fairing.solve.normal_equations import QuadraticPrior
from fairing.solve.point_fit import fitted_to_points
from fairing.solve.point_split import fitting_points
from fairing.solve.problem import Problem
from fairing.trace import SchedulePosition, StepReason, StepRecord

GAIN = 0.05  # smallest relative decrease of the mean loss (ledger: smoothing the start, fit to sparse points)
VERTEX_PASSES = 5
FIT_ROUNDS = 12
ROUNDS_AFTER_ROBUST_FIT = 4  # (ledger: choice of the fit)
ROUNDS_AFTER_STRAIGHTENING = 1  # (ledger: broad relations)
OBSERVED_PER_VERTEX = 1  # points whose photos are known that a fit needs (ledger: points for a fit)
POINTS_PER_VERTEX = 3  # other points that a fit needs: one for each coordinate


class Preparation(NamedTuple):
    """A change of the start that lowers the photo loss.

    Attributes:
        reason: SMOOTHED or FITTED_TO_POINTS.
        evaluation: energies afterwards.
        loss: mean loss per photo px afterwards.
        is_swept: whether it is a fit to points of surface sweeps, too.
    """

    reason: StepReason
    evaluation: Evaluation
    loss: float
    is_swept: bool

    @property
    def after(self) -> np.ndarray:
        """(n, 3) float: positions of the vertices afterwards, world units."""
        return self.evaluation.vertices


class Preparations:
    """The preparations of one run's start. What the plan computed, the steps use: both begin with the same vertices."""

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        self._evaluations: dict[bytes, Evaluation] = {}
        self._prepared: dict[tuple[StepReason, bytes], Preparation] = {}

    def clear(self) -> None:
        """Forget what was computed; steps compute it again when needed."""
        self._evaluations.clear()
        self._prepared.clear()

    def find(self) -> list[Preparation]:
        """The preparations, in their order, that are enabled and that the photos accept.

        Smoothing does so where the vertices are noisy. Such a run also uses the smoothness prior at its levels, which
        determines the vertices no photo sees. Where points were found in the photos, they must accept the smoothing as well:
        a start whose corners are displaced can look noisy to blurred photos (ledger: smoothing judged by points). The fit
        needs as many points as unlocked vertices if their photos are known, else as coordinates (`_points_suffice`).

        Raises:
            Cancelled: cancellation was requested.
        """
        problem, vertices = self._problem, self._problem.start
        step, has_judges = problem.options.step, points_can_judge(problem)
        fits = any(step.points) and _points_suffice(problem)
        smooths = any(step.smoothing) and (not has_judges or points_accept_smoothing(problem))
        done: list[Preparation] = []
        for reason, is_enabled in ((StepReason.SMOOTHED, smooths), (StepReason.FITTED_TO_POINTS, fits)):
            if not is_enabled:
                continue
            before, preparation = self._compared(reason, vertices, _TRIED[reason])
            if _is_accepted(before, preparation):
                done.append(preparation)
                vertices = preparation.after
        return done

    def fit(self, vertices: np.ndarray) -> np.ndarray:
        """(n, 3) float: vertices (n, 3) fitted to the sparse points, whether the photos accept it or not.

        Raises:
            Cancelled: cancellation was requested.
        """
        return self._compared(StepReason.FITTED_TO_POINTS, vertices, _TRIED[StepReason.FITTED_TO_POINTS])[1].after

    def step(self, reason: StepReason, position: SchedulePosition, vertices: np.ndarray) -> StepRecord:
        """The step of one preparation; its objective is the mean loss per photo px.

        Args:
            reason: SMOOTHED or FITTED_TO_POINTS.
            position: of the step, and of the following one.
            vertices: (n, 3) float: positions before it, world units.

        Raises:
            Cancelled: cancellation was requested.
        """
        before, preparation = self._compared(reason, vertices, "preparing the start")
        ids = np.flatnonzero((preparation.after != vertices).any(axis=1))
        losses = _mean_loss(before), preparation.loss
        return moved_record(self._problem, position, 0, ids, before, preparation.evaluation, reason, objectives=losses)

    def second_fit(self, position: SchedulePosition, moment: int, vertices: np.ndarray) -> StepRecord:
        """The step of a second fit to the sparse points, see `fairing.run.phases.SecondFit`; vertices stay if the photos reject it.

        Args:
            position: of the step, and of the following one.
            moment: before it.
            vertices: (n, 3) float: positions then, world units.

        Raises:
            Cancelled: cancellation was requested.
        """
        before, fitted = self._compared(StepReason.FITTED_TO_POINTS, vertices, "fitting to the sparse points once more")
        self.clear()
        ids = np.flatnonzero((fitted.after != vertices).any(axis=1))
        losses, after, reason = (_mean_loss(before), fitted.loss), fitted.evaluation, StepReason.FITTED_AGAIN
        if not _is_accepted(before, fitted):
            after, reason = before, StepReason.REJECTED_FIT
        return moved_record(self._problem, position, moment, ids, before, after, reason, objectives=losses)

    def _compared(self, reason: StepReason, vertices: np.ndarray, doing: str) -> tuple[Evaluation, Preparation]:
        """Energies at vertices (n, 3), and their preparation."""
        key = vertices.tobytes()
        with self._problem.work.doing(doing, 2) as work:
            if key not in self._evaluations:
                self._evaluations[key] = _evaluate(self._problem, vertices)
            work.advance()
            if (reason, key) not in self._prepared:
                preparation = _prepare(self._problem, reason, vertices)
                self._prepared[reason, key] = preparation
                self._evaluations[preparation.after.tobytes()] = preparation.evaluation
        return self._evaluations[key], self._prepared[reason, key]


def preparation_reasons(plan: RunPlan) -> list[StepReason]:
    """The preparations of a planned run, in their order, one step each."""
    planned = {StepReason.SMOOTHED: plan.is_smoothed, StepReason.FITTED_TO_POINTS: plan.is_fitted_to_points}
    return [reason for reason, is_planned in planned.items() if is_planned]


def _prepare(problem: Problem, reason: StepReason, vertices: np.ndarray) -> Preparation:
    """The preparation of vertices (n, 3).

    The robust fit reaches farther and leaves out clutter; a fit to closest points goes on from there (ledger: choice of the
    fit). Then what follows the axes of a building is straightened, which brings points to faces they could not belong to before
    (ledger: broad relations).
    """
    near, rounds, error = None, FIT_ROUNDS, 0.0
    if reason is StepReason.SMOOTHED:
        after = _smoothed(problem, vertices)
    else:
        if len(problem.observed_points):
            (vertices, near, error), rounds = swept_fit(problem, vertices), ROUNDS_AFTER_ROBUST_FIT
        to_points = fitted_to_points(problem, vertices, rounds, near)
        after = _straightened(problem, to_points, error)
        if (after != to_points.targets).any():
            to_points = fitted_to_points(problem, after, ROUNDS_AFTER_STRAIGHTENING, near)
            after = _straightened(problem, to_points, error)
    evaluation = _evaluate(problem, after)
    return Preparation(reason, evaluation, _mean_loss(evaluation), is_swept=near is not None and len(near) > 0)


def _is_accepted(before: Evaluation, preparation: Preparation) -> bool:
    """Whether a preparation lowers the mean loss of the photos by `GAIN`.

    A fit to points of surface sweeps need only lower it at all: coarse photos of a start some pixels off discriminate
    little (ledger: fit that the points call for).
    """
    gain = 1 - preparation.loss / max(_mean_loss(before), 1e-300)
    return gain > (0.0 if preparation.is_swept else GAIN)


def near_points(problem: Problem, plan: RunPlan, begun_again: np.ndarray | None) -> FeaturePoints | None:
    """The points of the surface sweeps of the last fit; found anew where `Problem.near_points` lacks them, as in a resumed run.

    Args:
        begun_again: (n, 3) float: the vertices before a second fit, world units; None before one.

    Raises:
        Cancelled: cancellation was requested.
    """
    if len(problem.observed_points) == 0:
        return None
    if begun_again is not None:
        begun = begun_again
    elif plan.is_fitted_to_points:
        begun = _smoothed(problem, problem.start) if plan.is_smoothed else problem.start
    else:
        return None
    kept = problem.near_points.get(begun.tobytes())
    return swept_fit(problem, begun).points if kept is None else kept


def _smoothed(problem: Problem, vertices: np.ndarray) -> np.ndarray:
    """(n, 3) float: vertices (n, 3) after smoothing, except where that would fold a face."""
    problem.raise_if_cancelled()
    return problem.moved_to(vertices, smoothed(problem.scene.mesh, vertices, VERTEX_PASSES))


def _straightened(problem: Problem, to_points: QuadraticPrior, error: float) -> np.ndarray:
    """(n, 3) float: vertices fitted to points moved onto the axes of a building, except where that would fold a face.

    Args:
        error: px: distance of the vertices from their true positions before the fit; 0 if it is not known.
    """
    vertices, faces = to_points.targets, problem.scene.mesh.faces
    pixel = pixel_size([view.camera for view in problem.scene.views], vertices)
    straight = straightened_from_afar(vertices, faces, problem.locked, pixel, to_points.hessians, error)
    return problem.moved_to(vertices, straight)


def points_accept_smoothing(problem: Problem) -> bool:
    """Whether the points held back lie nearer to the smoothed start than to the start."""
    mesh, cameras = problem.scene.mesh, [view.camera for view in problem.scene.views]
    plain, smooth = (
        held_back_loss(mesh.moved(vertices), cameras, problem.observed_points)
        for vertices in (problem.start, _smoothed(problem, problem.start))
    )
    return smooth < plain


_TRIED: dict[StepReason, str] = {
    StepReason.SMOOTHED: "trying a smoothed start",
    StepReason.FITTED_TO_POINTS: "trying a start fitted to the sparse points",
}


def points_can_judge(problem: Problem) -> bool:
    """Whether there are enough points whose photos are known: they show which faces the points belong to."""
    return any(problem.options.step.points) and _points_suffice(problem) and len(problem.observed_points) > 0


def _points_suffice(problem: Problem) -> bool:
    """Whether there are points enough for a fit: fewer would be met with all their noise.

    The robust fit, to points whose photos are known, has a prior for what they leave undetermined.
    """
    n_free, n_observed = int((~problem.locked).sum()), len(problem.observed_points)
    if n_observed:
        return n_observed >= OBSERVED_PER_VERTEX * n_free
    return len(fitting_points(problem.scene)) >= POINTS_PER_VERTEX * n_free


def _evaluate(problem: Problem, vertices: np.ndarray) -> Evaluation:
    """Energies at the first fine level, by the photos that see the faces there; coarser levels discriminate less."""
    level, robust = first_fine_level(problem.options), problem.options.robust
    context = problem.context(level, vertices)
    sigma = np.full(len(problem.scene.mesh.faces), fixed_sigma(robust, level) or 0.0)
    if fixed_sigma(robust, level) is None:
        sigma = robust_sigma(robust, level, problem.measure(context, vertices, np.ones(len(sigma))))
    return Evaluation(vertices, context, problem.energies(context, vertices, robust_scale(robust, sigma)))


def _mean_loss(evaluation: Evaluation) -> float:
    """Mean loss per photo px."""
    system = evaluation.system
    loss, pixels = loss_of_faces(evaluation.context, system.energy, system.faces)
    return float((loss * pixels).sum() / max(pixels.sum(), 1e-300))
