"""Steps of smoothing and of fits: one iteration, or one verdict of a judge, each one record."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fairing.cells.level_choice import first_fine_level
from fairing.geometry.normal_filter import filtered_normals, moves_to_planes, planes_energy
from fairing.geometry.pixel_size import pixel_size
from fairing.optimize.iteration import Iteration, iterate, tried
from fairing.optimize.rows import Term
from fairing.run.records import Measured, build_record, px_of_steps
from fairing.solve.energy import loss_of_faces
from fairing.solve.problem import Problem
from fairing.stage_kind import StageKind
from fairing.trace import SchedulePosition, StepReason, StepRecord


def smoothing_iteration(problem: Problem, begun: np.ndarray, vertices: np.ndarray) -> tuple[np.ndarray, Iteration]:
    """One pass of the normal filter: the vertices (u,) int that may move, and their iteration.

    Args:
        begun: (n, 3) float, world units: when smoothing began; the filtered normals there are the target.
        vertices: (n, 3) float, world units: now.
    """
    mesh, ids = problem.scene.mesh, np.flatnonzero(~problem.locked)
    normals = filtered_normals(mesh, begun)
    proposed = moves_to_planes(mesh, vertices, normals)[ids]
    return ids, tried(proposed, vertices, ids, problem.unfolded, lambda places: planes_energy(mesh, places, normals))


def fit_iteration(problem: Problem, terms: Sequence[Term], vertices: np.ndarray) -> tuple[np.ndarray, Iteration]:
    """One iteration of a fit from vertices (n, 3) float, world units: the vertices (u,) int that move, and their iteration."""
    ids = movable(problem, vertices)
    return ids, iterate(terms, vertices, ids, problem.unfolded)


def movable(problem: Problem, vertices: np.ndarray) -> np.ndarray:
    """(u,) int: vertices that a fit moves: neither locked nor out of every photo."""
    pixel = pixel_size(problem.cameras, vertices)
    return np.flatnonzero(~problem.locked & np.isfinite(pixel))


def point_verdict(
    problem: Problem, position: SchedulePosition, moment: int, vertices: np.ndarray, kept: np.ndarray
) -> StepRecord:
    """The record of a judge by points; kept (n, 3): vertices (n, 3) after its verdict, world units."""
    ids = np.flatnonzero((kept != vertices).any(axis=1))
    return build_record(problem, position, moment, ids, vertices, kept, StepReason.RETURNED, StageKind.JUDGE)


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
        record = build_record(
            problem, position, moment, nothing, begun, vertices, StepReason.RETURNED, StageKind.JUDGE, (before, after)
        )
    else:
        losses, moved = losses[::-1], (vertices != begun).any(axis=1)
        back = np.flatnonzero(moved | ~moved.any())  # a record without vertices would not show the verdict
        record = build_record(
            problem, position, moment, back, vertices, begun, StepReason.REJECTED_FIT, StageKind.JUDGE, (after, before)
        )
    return replace(record, objective_before=losses[0], objective_after=losses[1])


def evaluated(problem: Problem, vertices: np.ndarray) -> Measured:
    """Energies at the first fine level, by the photos that see the faces there; coarser levels discriminate less."""
    context = problem.context(first_fine_level(problem.options), vertices)
    scale = problem.norm.squared_scale(problem.sigma(context, vertices))
    return Measured(context, problem.energies(context, vertices, scale))


def mean_loss(measured: Measured) -> float:
    """Mean loss per photo px."""
    loss, pixels = loss_of_faces(*measured)
    return float((loss * pixels).sum() / max(pixels.sum(), 1e-300))


def iteration_record(
    problem: Problem,
    kind: StageKind,
    position: SchedulePosition,
    sweep_moment: int,
    vertices: np.ndarray,
    ids: np.ndarray,
    iteration: Iteration,
) -> tuple[StepRecord, bool]:
    """The record of an iteration of vertices `ids` (u,) int, and whether every vertex has converged, or the step was rejected.

    Args:
        kind: of the stage.
        sweep_moment: the moment at which the sweep began.
        vertices: (n, 3) float, world units: before the iteration.
    """
    step_px = px_of_steps(problem, vertices, ids, iteration.after[ids] - vertices[ids])
    has_converged = iteration.accepted & (step_px < problem.options.step.tolerance)
    reasons = np.full(len(ids), StepReason.ACCEPTED if iteration.accepted else StepReason.REJECTED_ENERGY)
    reasons[has_converged] = StepReason.CONVERGED
    reasons[iteration.folds & (step_px == 0)] = StepReason.REJECTED_FOLD
    record = replace(
        build_record(problem, position, sweep_moment, ids, vertices, iteration.after, reasons, kind),
        proposed=iteration.proposed,
        objective_before=iteration.objectives[0],
        objective_after=iteration.objectives[1],
    )
    return record, bool((has_converged | (reasons != StepReason.ACCEPTED)).all())
