"""Step records: one builder, and the records of steps that put vertices elsewhere or move none."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fairing.cells.context import CellContext
from fairing.run.sweep import SweepState
from fairing.solve.energy import FaceSystem
from fairing.solve.point_split import observed_held_out_points
from fairing.solve.problem import Problem
from fairing.stage_kind import StageKind
from fairing.terms.point_judge import points_prefer
from fairing.trace import SchedulePosition, StepReason, StepRecord, stage_of_reasons


class Evaluation(NamedTuple):
    """Energies of faces with the vertices at given positions.

    Attributes:
        vertices: (n, 3) float: the positions, world units.
        context: visibility and cells.
        system: energies of the faces.
    """

    vertices: np.ndarray
    context: CellContext
    system: FaceSystem


class Energies(NamedTuple):
    """Energies before or after a step.

    Attributes:
        by_face: (F,) float: of the faces around the block.
        by_view: (V,) float: summed over the faces by view.
    """

    by_face: np.ndarray
    by_view: np.ndarray


class SolverState(NamedTuple):
    """Levenberg-Marquardt state of the u vertices of a block.

    Attributes:
        damping: (u,) float, used in the step.
        eigenvalues: (u, 3) float: of the normal matrices without priors, ascending, energy / world unit^2.
        damping_next: (u,) float, for the next iteration.
        rejections: (u,) int: in a row.
    """

    damping: np.ndarray
    eigenvalues: np.ndarray
    damping_next: np.ndarray
    rejections: np.ndarray

    @classmethod
    def unused(cls, n_vertices: int) -> "SolverState":
        """The state of a step that solves no system."""
        zeros = np.zeros(n_vertices)
        return cls(zeros, np.zeros((n_vertices, 3)), zeros, np.zeros(n_vertices, dtype=np.int64))


def build_record(
    position: SchedulePosition,
    sweep_moment: int,
    ids: np.ndarray,
    positions: tuple[np.ndarray, np.ndarray],
    *,
    proposed: np.ndarray,
    step_px: np.ndarray,
    reasons: np.ndarray,
    objectives: tuple[float, float],
    faces: np.ndarray,
    energies: tuple[Energies, Energies],
    solver: SolverState | None = None,
    stage: StageKind | None = None,
) -> StepRecord:
    """A record whose next position is its own; pairs are (before, after).

    Args:
        ids: (u,) int: the vertices of the block.
        positions: (u, 3) float each, world units.
        proposed: (u, 3) float, world units.
        step_px: (u,) float.
        reasons: (u,) `StepReason`.
        faces: (F,) int.
        solver: default: no system was solved.
        stage: default: that of steps with these reasons.
    """
    solver = solver or SolverState.unused(len(ids))
    before, after = energies
    return StepRecord(
        position=position,
        next_position=position,
        sweep_moment=sweep_moment,
        vertices=ids,
        before=positions[0],
        proposed=proposed,
        after=positions[1],
        step_px=step_px,
        reasons=reasons.astype(np.int8),
        objective_before=objectives[0],
        objective_after=objectives[1],
        faces=faces,
        face_energy_before=before.by_face,
        face_energy_after=after.by_face,
        view_energy_before=before.by_view,
        view_energy_after=after.by_view,
        **solver._asdict(),
        stage=stage_of_reasons(reasons) if stage is None else stage,
    )


def moved_record(
    problem: Problem,
    position: SchedulePosition,
    sweep_moment: int,
    ids: np.ndarray,
    before: Evaluation,
    after: Evaluation,
    reason: StepReason,
    objectives: tuple[float, float] | None = None,
    stage: StageKind | None = None,
) -> StepRecord:
    """The record of vertices (u,) that go from their positions in `before` to those in `after`; same faces in both.

    Args:
        objectives: before and after; default: the energies.
        stage: see `build_record`.
    """
    steps = after.vertices[ids] - before.vertices[ids]
    return build_record(
        position,
        sweep_moment,
        ids,
        (before.vertices[ids], after.vertices[ids]),
        proposed=steps,
        step_px=problem.pixels_moved(before.context, before.vertices, ids, steps),
        reasons=np.full(len(ids), reason),
        objectives=objectives or (float(before.system.energy.sum()), float(after.system.energy.sum())),
        faces=before.system.faces,
        energies=(_energies(before), _energies(after)),
        stage=stage,
    )


def empty_record(
    problem: Problem, position: SchedulePosition, sweep_moment: int, next_position: SchedulePosition
) -> StepRecord:
    """The record of a step that moves nothing, because no vertex can move or none needs to."""
    ids, points = np.zeros(0, dtype=int), np.zeros((0, 3))
    nothing = Energies(np.zeros(0), np.zeros(len(problem.scene.views)))
    record = build_record(
        position, sweep_moment, ids, (points, points), proposed=points, step_px=np.zeros(0), reasons=ids,
        objectives=(0.0, 0.0), faces=ids, energies=(nothing, nothing),
    )  # fmt: skip
    return replace(record, next_position=next_position)


def end_verdict(
    problem: Problem,
    sweep: SweepState,
    position: SchedulePosition,
    moment: int,
    vertices: np.ndarray,
    begun: np.ndarray,
) -> StepRecord:
    """The record of the judge of the end: every vertex goes back to `begun` if the mesh was better there.

    It was if the energy is lower, or if the sparse points that no fit uses clearly lie nearer (ledger: end judged by points).

    Args:
        sweep: the last sweep.
        vertices: (n, 3) float: positions after it, world units.
        begun: (n, 3) float: positions at the start, or after the last manual edit.
    """
    here, there = (
        Evaluation(places, sweep.context, problem.energies(sweep.context, places, sweep.scale))
        for places in (vertices, begun)
    )
    if here.system.energy.sum() <= there.system.energy.sum() and not held_out_points_prefer(
        problem, vertices, begun, without=False
    ):
        nothing = np.zeros(0, dtype=int)
        return moved_record(problem, position, moment, nothing, here, here, StepReason.RETURNED, stage=StageKind.JUDGE)
    everything = np.arange(len(vertices))
    return moved_record(problem, position, moment, everything, here, there, StepReason.RETURNED)


def held_out_points_prefer(problem: Problem, before: np.ndarray, after: np.ndarray, *, without: bool) -> bool:
    """Whether the observed points that no fit uses clearly prefer the second of two states (n, 3), world units.

    Args:
        without: the answer where there are no such points, or the run does without points.
    """
    held_out = observed_held_out_points(problem.scene)
    if not problem.options.uses_points or len(held_out) == 0:
        return without
    mesh, cameras = problem.scene.mesh, [view.camera for view in problem.scene.views]
    return points_prefer(mesh.moved(before), mesh.moved(after), cameras, held_out)


def _energies(evaluation: Evaluation) -> Energies:
    system = evaluation.system
    return Energies(system.energy, evaluation.context.sum_by_view(system.pair_energy))
