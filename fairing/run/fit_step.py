"""Steps of smoothing and of fits: one iteration, or one verdict of a judge, each one record."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fairing.cells.level_choice import first_fine_level
from fairing.geometry.normal_filter import filtered_normals, moves_to_planes, planes_energy
from fairing.geometry.pixel_size import pixel_size
from fairing.optimize.iteration import OBJECTIVE_TOLERANCE, Iteration, iterate
from fairing.optimize.rows import Term
from fairing.run.records import Energies, Evaluation, build_record, moved_record
from fairing.run.stages import Stage
from fairing.solve.energy import loss_of_faces
from fairing.solve.problem import Problem
from fairing.stage_kind import StageKind
from fairing.trace import SchedulePosition, StepReason, StepRecord


class FitStep(NamedTuple):
    """Attributes:
    record: its next position is its own; the stepper replaces it.
    is_done: whether every vertex has converged, or the step was rejected.
    """

    record: StepRecord
    is_done: bool


def fit_step(
    problem: Problem,
    stage: Stage,
    terms: tuple[Term, ...],
    position: SchedulePosition,
    sweep_moment: int,
    vertices: np.ndarray,
) -> FitStep:
    """One iteration of a fit from vertices (n, 3) float, world units.

    Args:
        terms: of the sweep.
        sweep_moment: the moment at which it began.

    Raises:
        Cancelled: cancellation was requested.
    """
    problem.raise_if_cancelled()
    ids = movable(problem, vertices)
    return _recorded(
        problem, stage, position, sweep_moment, vertices, ids, iterate(terms, vertices, ids, problem.unfolded)
    )


def smoothing_step(
    problem: Problem,
    stage: Stage,
    position: SchedulePosition,
    sweep_moment: int,
    begun: np.ndarray,
    vertices: np.ndarray,
) -> FitStep:
    """One pass of the normal filter over vertices (n, 3) float, world units.

    Args:
        sweep_moment: the moment at which smoothing began.
        begun: (n, 3) float: vertices then, whose filtered normals are the target.

    Raises:
        Cancelled: cancellation was requested.
    """
    problem.raise_if_cancelled()
    mesh, ids = problem.scene.mesh, np.flatnonzero(~problem.locked)
    normals = filtered_normals(mesh, begun)
    proposed = moves_to_planes(mesh, vertices, normals)[ids]
    tried, folds = problem.unfolded(vertices, ids, proposed)
    after = vertices.copy()
    after[ids] += tried
    before, then = planes_energy(mesh, vertices, normals), planes_energy(mesh, after, normals)
    accepted = then <= before * (1 + OBJECTIVE_TOLERANCE)
    iteration = Iteration(proposed, after if accepted else vertices, folds, (before, then), accepted)
    return _recorded(problem, stage, position, sweep_moment, vertices, ids, iteration)


def movable(problem: Problem, vertices: np.ndarray) -> np.ndarray:
    """(u,) int: vertices that a fit moves: neither locked nor out of every photo."""
    pixel = pixel_size([view.camera for view in problem.scene.views], vertices)
    return np.flatnonzero(~problem.locked & np.isfinite(pixel))


def point_verdict(
    problem: Problem, position: SchedulePosition, moment: int, vertices: np.ndarray, kept: np.ndarray
) -> StepRecord:
    """The record of a judge by points; kept (n, 3): vertices (n, 3) after its verdict, world units."""
    ids = np.flatnonzero((kept != vertices).any(axis=1))
    return _unmeasured(problem, StageKind.JUDGE, position, moment, vertices, ids, kept, StepReason.RETURNED)


def photo_verdict(
    problem: Problem,
    position: SchedulePosition,
    moment: int,
    begun: np.ndarray,
    vertices: np.ndarray,
    least_gain: float,
) -> StepRecord:
    """The record of a judge by photos: all vertices go back where their mean loss does not fall by a gain.

    Coarse photos judge: a fine level's, at which the fit's way can be seen. The objective is the mean loss per photo px, before
    smoothing or fit and after it.

    Args:
        begun: (n, 3) float: before smoothing or fit, world units.
        vertices: (n, 3) float: after it.
        least_gain: relative; the loss must fall by more.

    Raises:
        Cancelled: cancellation was requested.
    """
    with problem.work.doing("comparing with the photos", 2) as work:
        before, after = (evaluated(problem, places) for places in work.each((begun, vertices)))
    losses = mean_loss(before), mean_loss(after)
    if 1 - losses[1] / max(losses[0], 1e-300) > least_gain:
        nothing = np.zeros(0, dtype=int)
        return moved_record(
            problem, position, moment, nothing, before, after, StepReason.RETURNED, losses, StageKind.JUDGE
        )
    moved = (vertices != begun).any(axis=1)
    back = np.flatnonzero(moved | ~moved.any())  # a record without vertices would not show the verdict
    return moved_record(
        problem, position, moment, back, after, before, StepReason.REJECTED_FIT, (losses[1], losses[0]), StageKind.JUDGE
    )


def evaluated(problem: Problem, vertices: np.ndarray) -> Evaluation:
    """Energies at the first fine level, by the photos that see the faces there; coarser levels discriminate less."""
    context = problem.context(first_fine_level(problem.options), vertices)
    scale = problem.norm.squared_scale(problem.sigma(context, vertices))
    return Evaluation(vertices, context, problem.energies(context, vertices, scale))


def mean_loss(evaluation: Evaluation) -> float:
    """Mean loss per photo px."""
    system = evaluation.system
    loss, pixels = loss_of_faces(evaluation.context, system)
    return float((loss * pixels).sum() / max(pixels.sum(), 1e-300))


def _recorded(
    problem: Problem,
    stage: Stage,
    position: SchedulePosition,
    sweep_moment: int,
    vertices: np.ndarray,
    ids: np.ndarray,
    iteration: Iteration,
) -> FitStep:
    """The record of an iteration of vertices `ids` (u,) int."""
    step_px = _step_px(problem, vertices, ids, iteration.after[ids] - vertices[ids])
    has_converged = iteration.accepted & (step_px < problem.options.step.tolerance)
    reasons = np.full(len(ids), StepReason.ACCEPTED if iteration.accepted else StepReason.REJECTED_ENERGY)
    reasons[has_converged] = StepReason.CONVERGED
    reasons[iteration.folds & (step_px == 0)] = StepReason.REJECTED_FOLD
    record = _unmeasured(problem, stage.kind, position, sweep_moment, vertices, ids, iteration.after, reasons)
    record = replace(
        record,
        proposed=iteration.proposed,
        objective_before=iteration.objectives[0],
        objective_after=iteration.objectives[1],
    )
    return FitStep(record, bool((has_converged | (reasons != StepReason.ACCEPTED)).all()))


def _unmeasured(
    problem: Problem,
    kind: StageKind,
    position: SchedulePosition,
    sweep_moment: int,
    vertices: np.ndarray,
    ids: np.ndarray,
    after: np.ndarray,
    reasons: np.ndarray | StepReason,
) -> StepRecord:
    """The record of vertices `ids` (u,) int that go from positions (n, 3) to others (n, 3), without energies of photos."""
    steps, nothing = after[ids] - vertices[ids], Energies(np.zeros(0), np.zeros(len(problem.scene.views)))
    return build_record(
        position,
        sweep_moment,
        ids,
        (vertices[ids], after[ids]),
        proposed=steps,
        step_px=_step_px(problem, vertices, ids, steps),
        reasons=np.broadcast_to(np.asarray(reasons), len(ids)),
        objectives=(0.0, 0.0),
        faces=np.zeros(0, dtype=int),
        energies=(nothing, nothing),
        stage=kind,
    )


def _step_px(problem: Problem, vertices: np.ndarray, ids: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """(u,) float, px: lengths of steps (u, 3) as the median photo sees them at a right angle."""
    pixel = pixel_size([view.camera for view in problem.scene.views], vertices)[ids]
    return np.nan_to_num(np.linalg.norm(steps, axis=1) / pixel)
