"""Restart: vertices that fit poorly are optimized again from their origin, and the two results are fused.

A vertex at a wrong position keeps its neighbours at theirs: none of them can improve alone. The second time, everything
around them is at its place. The second result is seldom better everywhere, so it is fused with the first
(`fairing.run.fusion`). (ledger: searches and restarts)
"""

from dataclasses import replace

import numpy as np

from fairing.geometry.normals import folded_faces
from fairing.options import FairingOptions
from fairing.run.fusion import evaluate_faces, fused, group_losses
from fairing.run.gauss_newton_step import gauss_newton_step
from fairing.run.phases import GaussNewton, Level, Restart, Schedule
from fairing.run.records import empty_record, moved_record
from fairing.run.search_step import coarser_cells, search_around
from fairing.run.sweep import SweepState, begin_sweep, fits_poorly
from fairing.solve.blocks import Block, group_block
from fairing.solve.problem import Problem
from fairing.trace import SchedulePosition, StepReason, StepRecord
from fairing.work import number_of

SHARP_SWEEPS = 2  # of Gauss-Newton on sharp cells, at the end of the second optimization
# Factor of the spacing of cell samples: half of them discriminate positions that blurred cells confuse.
SHARP_SPACING = 1.4
SHARP_CELL = 64  # samples along an edge, at most


def restart(
    problem: Problem,
    schedule: Schedule,
    sweep: SweepState,
    block: Block,
    position: SchedulePosition,
    vertices: np.ndarray,
) -> StepRecord:
    """The step of a block to be restarted: those of its vertices that still fit poorly.

    Args:
        schedule: the levels of the run.
        sweep: the sweep of the step.
        block: the candidates.
        position: of the step; the record's next position is the same.
        vertices: (n, 3) float: positions before it, world units.

    Raises:
        Cancelled: cancellation was requested.
    """
    assert isinstance(sweep.phase, Restart)
    mesh, number = problem.scene.mesh, position.level
    sharp = problem.under(_sharp_with_fixed_sigma(problem.options))
    context = sharp.context(number, vertices)
    poor = fits_poorly(mesh, context, sharp.energies(context, vertices, sweep.scale), sweep.free)
    ids = block.vertices[poor[block.vertices]]
    if len(ids) == 0:
        return empty_record(problem, position, sweep.moment, position)
    among = np.isin(np.arange(len(vertices)), ids)
    second = vertices.copy()
    second[ids] = sweep.origin[ids]
    levels = schedule.levels[sweep.phase.from_level : number]
    with problem.work.doing(
        f"restarting {number_of(len(ids), 'vertex', 'vertices')}", len(levels) + 2, "stage"
    ) as work:
        for level in work.each(levels):
            second = _searched(problem, level, second, sweep, among)
            second = _refined(problem, level, level.gauss_newton, second, sweep, among)
        level = schedule.levels[number]
        second = _refined(sharp, level, replace(level.gauss_newton, max_sweeps=SHARP_SWEEPS), second, sweep, among)
        work.advance()
        after = fused(sharp, sweep, vertices, second)
    while (folded := folded_faces(vertices, after, problem.start, mesh.faces, problem.options.step)).any():
        after[mesh.faces[folded]] = vertices[mesh.faces[folded]]
    return _record(sharp, sweep, position, ids, vertices, after)


def _sharp_with_fixed_sigma(options: FairingOptions) -> FairingOptions:
    """Sharp cells and one sigma: positions are refined on what they are compared by."""
    cells = coarser_cells(options.cells, SHARP_SPACING, SHARP_CELL)
    return replace(options, cells=cells, robust=replace(options.robust, sigma_rule=("fixed",)))


def _searched(
    problem: Problem, level: Level, vertices: np.ndarray, parent: SweepState, among: np.ndarray
) -> np.ndarray:
    """(n, 3) float: vertices (n, 3) after the local search of a level, if it has one, by those of a mask (n,) alone."""
    places = vertices.copy()
    if level.search is None:
        return places
    plain = replace(level, smoothing=0.0, attraction=0.0)
    sweep = begin_sweep(problem, plain, level.search, 0, vertices, parent.origin, among, parent.near_points)
    for block in sweep.blocks:
        places[block.vertices] = search_around(problem, sweep, block, places, level.search).after
    return places


def _refined(
    problem: Problem, level: Level, phase: GaussNewton, vertices: np.ndarray, parent: SweepState, among: np.ndarray
) -> np.ndarray:
    """(n, 3) float: vertices (n, 3) after Gauss-Newton sweeps at a level by those of a mask (n,) alone."""
    places, level = vertices, replace(level, smoothing=0.0)
    for _ in range(phase.max_sweeps):
        sweep = begin_sweep(problem, level, phase, 0, places, parent.origin, among, parent.near_points)
        for block in sweep.blocks:
            previous, system = None, None
            for iteration in range(phase.max_iterations):
                position = SchedulePosition(level.number, 1, 0, iteration)
                step = gauss_newton_step(problem, sweep, block, position, places, previous, system)
                places, previous, system = step.record.applied_to(places), step.record, step.system
                if step.is_done:
                    break
        if sweep.longest_move(problem.scene, places) < phase.tolerance:
            break
    return places


def _record(
    problem: Problem,
    sweep: SweepState,
    position: SchedulePosition,
    ids: np.ndarray,
    before: np.ndarray,
    after: np.ndarray,
) -> StepRecord:
    """The record of vertices (u,) that go to their new positions if the mean loss around them falls; else they stay."""
    mesh = problem.scene.mesh
    around = np.isin(mesh.faces, ids).max(axis=1)
    here, there = (evaluate_faces(problem, sweep, vertices, around) for vertices in (before, after))
    block = group_block(mesh, [ids])
    old, new = (float(group_losses(sweep, mesh, evaluation, block)[0]) for evaluation in (here, there))
    if not new < old:
        there, new = here, old
    record = moved_record(
        problem, position, sweep.moment, ids, here, there, StepReason.FOUND_TOGETHER, objectives=(old, new)
    )
    moved = (record.after != record.before).any(axis=1)
    reasons = np.where(moved, StepReason.FOUND_TOGETHER, StepReason.NO_BETTER_PLACE).astype(np.int8)
    return replace(record, reasons=reasons)
