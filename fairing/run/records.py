"""Step records: one builder, and the records of steps that put vertices elsewhere or move none."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fairing.cells.context import CellContext
from fairing.geometry.pixel_size import pixel_size
from fairing.run.sweep import SweepState
from fairing.solve.energy import FaceSystem
from fairing.solve.point_split import observed_held_out_points
from fairing.solve.problem import Problem
from fairing.stage_kind import StageKind
from fairing.terms.own import OwnRows
from fairing.terms.point_judge import points_prefer
from fairing.trace import SchedulePosition, StepReason, StepRecord, stage_of_reasons


class Measured(NamedTuple):
    """Energies of faces: their visibility and cells, and what was computed of them."""

    context: CellContext
    system: FaceSystem


def build_record(
    problem: Problem,
    position: SchedulePosition,
    sweep_moment: int,
    ids: np.ndarray,
    before: np.ndarray,
    after: np.ndarray,
    reasons: np.ndarray | StepReason,
    stage: StageKind | None = None,
    measured: tuple[Measured, Measured] | None = None,
    step_px: np.ndarray | None = None,
) -> StepRecord:
    """The record of vertices `ids` (u,) int that go from positions (n, 3) float to others, world units.

    Its next position is its own, its objectives are the energies, and the proposed step is the one that was taken: no system was
    solved.

    Args:
        reasons: (u,) `StepReason`, or one for all.
        stage: default: that of steps with these reasons.
        measured: the same faces before and after; default: no energies were computed.
        step_px: (u,) float; default: of the step that was taken, in the photos of the faces or, without any, see `px_of_steps`.
    """
    reasons = np.broadcast_to(np.asarray(reasons), len(ids)).astype(np.int8)
    steps, zeros, faces = after[ids] - before[ids], np.zeros(len(ids)), np.zeros(0, dtype=int)
    by_face, by_view = [np.zeros(0)] * 2, [np.zeros(len(problem.scene.views))] * 2
    if measured is not None:
        faces, by_face = measured[0].system.faces, [each.system.energy for each in measured]
        by_view = [each.context.sum_by_view(each.system.pair_energy) for each in measured]
    if step_px is None and measured is not None:
        step_px = problem.pixels_moved(measured[0].context, before, ids, steps)
    return StepRecord(
        position=position,
        next_position=position,
        sweep_moment=sweep_moment,
        vertices=ids,
        before=before[ids],
        proposed=steps,
        after=after[ids],
        step_px=px_of_steps(problem, before, ids, steps) if step_px is None else step_px,
        damping=zeros,
        eigenvalues=np.zeros((len(ids), 3)),
        reasons=reasons,
        objective_before=float(by_face[0].sum()),
        objective_after=float(by_face[1].sum()),
        faces=faces,
        face_energy_before=by_face[0],
        face_energy_after=by_face[1],
        view_energy_before=by_view[0],
        view_energy_after=by_view[1],
        damping_next=zeros,
        rejections=np.zeros(len(ids), dtype=np.int64),
        stage=stage_of_reasons(reasons) if stage is None else stage,
    )


def px_of_steps(problem: Problem, vertices: np.ndarray, ids: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """(u,) float, px: lengths of steps (u, 3) of vertices `ids` (u,) as the median photo sees them at a right angle.

    Args:
        vertices: (n, 3) float: positions before the step, world units.
    """
    pixel = pixel_size(problem.cameras, vertices)[ids]
    return np.nan_to_num(np.linalg.norm(steps, axis=1) / pixel)


def empty_record(
    problem: Problem, position: SchedulePosition, sweep_moment: int, next_position: SchedulePosition
) -> StepRecord:
    """The record of a step that moves nothing, because no vertex can move or none needs to."""
    nothing = np.zeros(0, dtype=int)
    record = build_record(problem, position, sweep_moment, nothing, problem.start, problem.start, nothing)
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

    It was if the energy of the photos and of terms of one's own is lower, or if the sparse points that no fit uses clearly lie
    nearer (ledger: end judged by points).

    Args:
        sweep: the last sweep.
        vertices: (n, 3) float: positions after it, world units.
        begun: (n, 3) float: positions at the start, or after the last manual edit.
    """
    here, there = (
        Measured(sweep.context, problem.energies(sweep.context, places, sweep.scale)) for places in (vertices, begun)
    )
    own = [term for term in sweep.terms if isinstance(term, OwnRows)]
    energies = [
        measured.system.energy.sum() + sum(term.total(places) for term in own)
        for measured, places in ((here, vertices), (there, begun))
    ]
    if energies[0] <= energies[1] and not held_out_points_prefer(problem, vertices, begun, without=False):
        nothing = np.zeros(0, dtype=int)
        return build_record(
            problem, position, moment, nothing, vertices, vertices, StepReason.RETURNED, StageKind.JUDGE, (here, here)
        )
    everything = np.arange(len(vertices))
    return build_record(
        problem, position, moment, everything, vertices, begun, StepReason.RETURNED, measured=(here, there)
    )


def held_out_points_prefer(problem: Problem, before: np.ndarray, after: np.ndarray, *, without: bool) -> bool:
    """Whether the observed points that no fit uses clearly prefer the second of two states (n, 3), world units.

    Args:
        without: the answer where there are no such points, or the run does without points.
    """
    held_out = observed_held_out_points(problem.scene)
    if not problem.options.uses_points or len(held_out) == 0:
        return without
    mesh = problem.scene.mesh
    return points_prefer(mesh.moved(before), mesh.moved(after), problem.cameras, held_out)
