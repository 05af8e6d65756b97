"""Records of steps that no system was solved and no place searched for: nothing moves, or vertices are put elsewhere."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fairing.cells.context import CellContext
from fairing.run.sweep import SweepState
from fairing.solve.energy import FaceSystem
from fairing.solve.problem import Problem
from fairing.trace import SchedulePosition, StepReason, StepRecord


class Judged(NamedTuple):
    """Vertices at given places, as the photos see them there.

    Attributes:
        vertices: (n, 3) float, world units.
        context: who sees which face.
        system: energies of faces.
    """

    vertices: np.ndarray
    context: CellContext
    system: FaceSystem


def moved_record(
    problem: Problem,
    position: SchedulePosition,
    sweep_moment: int,
    ids: np.ndarray,
    before: Judged,
    after: Judged,
    reason: StepReason,
) -> StepRecord:
    """Vertices (u,) put from their places before to those after, both judged by the same faces; the run goes on at `position`."""
    blank, steps = np.zeros(len(ids)), after.vertices[ids] - before.vertices[ids]
    return StepRecord(
        position=position,
        next_position=position,
        sweep_moment=sweep_moment,
        vertices=ids,
        before=before.vertices[ids],
        proposed=steps,
        after=after.vertices[ids],
        step_px=problem.pixels_moved(before.context, before.vertices, ids, steps),
        damping=blank,
        eigenvalues=np.zeros((len(ids), 3)),
        reasons=np.full(len(ids), reason, dtype=np.int8),
        objective_before=float(before.system.energy.sum()),
        objective_after=float(after.system.energy.sum()),
        faces=before.system.faces,
        face_energy_before=before.system.energy,
        face_energy_after=after.system.energy,
        view_energy_before=before.context.sum_by_view(before.system.pair_energy),
        view_energy_after=after.context.sum_by_view(after.system.pair_energy),
        damping_next=blank,
        rejections=np.zeros(len(ids), dtype=np.int64),
    )


def empty_record(
    problem: Problem, position: SchedulePosition, sweep_moment: int, following: SchedulePosition
) -> StepRecord:
    """Go on elsewhere: no vertex can move here (every footprint is too small), or none needs to."""
    nothing, views = np.zeros(0), np.zeros(len(problem.scene.views))
    ids, points = nothing.astype(int), np.zeros((0, 3))
    return StepRecord(
        position, following, sweep_moment, ids, points, points, points, nothing,
        nothing, points, nothing.astype(np.int8), 0.0, 0.0, ids, nothing, nothing, views, views, nothing, ids,
    )  # fmt: skip


def returned_if_worse(
    problem: Problem, sweep: SweepState, last: StepRecord, before: np.ndarray, after: np.ndarray, begun: np.ndarray
) -> StepRecord:
    """A run's last step; or instead of it one that returns every vertex, if the energy was lower where it had begun.

    Args:
        sweep: the last one.
        before, after: (n, 3) float: vertices before and after the last step, world units.
        begun: (n, 3) float: at the start, or after the last move by hand.
    """
    here, there = (
        Judged(places, sweep.context, problem.measure(sweep.context, places, sweep.scale)) for places in (after, begun)
    )
    if here.system.energy.sum() <= there.system.energy.sum():
        return last
    everything = np.arange(len(after))
    here = here._replace(vertices=before)
    returned = moved_record(problem, last.position, last.sweep_moment, everything, here, there, StepReason.RETURNED)
    return replace(returned, next_position=last.next_position)
