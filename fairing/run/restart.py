"""A second try for vertices that fit badly together: all go back to where the run began and are searched for anew.

A vertex in a wrong place holds its neighbours in theirs: none of them can leave alone, as beside a wrong neighbour the
true place is no better. The second time, everything around them is in its place. What comes out is seldom better
everywhere, so the two results are fused (Lempitsky, Rother, Roth, Blake: Fusion Moves for Markov Random Field
Optimization, PAMI 2010): first connected groups of vertices, then single ones are taken from the second where they fit
better on sharp cells.

Facade, a whole run, determined and (what three photos see) rms: 0.324 (0.275) without, 0.293 (0.246) % with one after the last
search; median 0.052 -> 0.046; 13 -> 10 vertices farther off than at the start by more than 0.1 %. What two more after the last
Gauss-Newton sweeps bring stands in `schedule`. Tried, too, from a recorded run with 0.306 (0.262):
- A further try from the first fine level: 0.309 (0.260) instead of 0.305 (0.263), on coarser cells.
- Taking whole groups alone: 0.311 instead of 0.305 after the single vertices.
- Polishing the first result as well before the two are fused: the photos that come into view raised the mean loss from
  0.00127 to 0.00147, and nothing was taken.
What is still wrong are vertices along the arch, which slide where the photos hardly tell, and hidden ones of the porch.
"""

from dataclasses import replace

import numpy as np

from fairing.geometry.normals import folded_faces
from fairing.mesh import Mesh
from fairing.options import FairingOptions, by_level
from fairing.run.gauss_newton_step import gauss_newton_step
from fairing.run.local_search import mean_loss
from fairing.run.records import Judged, empty_record, moved_record
from fairing.run.search_step import search_around, sharp_options
from fairing.run.start_estimate import Start
from fairing.run.sweep import BADLY, SweepState, begin_sweep, fits_badly
from fairing.solve.blocks import Block, connected_groups, group_block, independent_block, independent_sets
from fairing.solve.problem import Problem
from fairing.trace import SchedulePosition, StepReason, StepRecord

POLISH_SWEEPS = 2  # on sharp cells, of the second result
MOVED = 1.0  # px: places nearer to each other are the same
EXCHANGES = 2  # rounds in which single vertices are taken from the other result


def restart(
    problem: Problem,
    start: Start,
    sweep: SweepState,
    candidates: np.ndarray,
    begin: int,
    position: SchedulePosition,
    vertices: np.ndarray,
) -> StepRecord:
    """Try those of some vertices (u,) again that still fit badly.

    Args:
        sweep: the search it belongs to.
        begin: level to begin at.
        position: where the step belongs; the record's next position is the same.
        vertices: (n, 3) float: where they are, world units.

    Raises:
        Cancelled: nobody wants it any more.
    """
    mesh, level = problem.scene.mesh, position.level
    sharp = problem.under(_judging(problem.options))
    context = sharp.context(level, vertices)
    badly = fits_badly(mesh, context, sharp.measure(context, vertices, sweep.scale), sweep.free, BADLY)
    ids = candidates[badly[candidates]]
    if len(ids) == 0:
        return empty_record(problem, position, sweep.moment, position)
    among = np.isin(np.arange(len(vertices)), ids)
    again = vertices.copy()
    again[ids] = sweep.origin[ids]
    for coarser in range(begin, level):
        again = _searched(problem, start, coarser, again, sweep, among)
        n_sweeps = by_level(problem.options.schedule.max_sweeps, coarser)
        again = _refined(problem, start, coarser, again, sweep, among, n_sweeps)
    again = _refined(sharp, start, level, again, sweep, among, POLISH_SWEEPS)
    after = fused(sharp, sweep, vertices, again)
    while (folded := folded_faces(vertices, after, problem.start, mesh.faces, problem.options.step)).any():
        after[mesh.faces[folded]] = vertices[mesh.faces[folded]]
    return _record(sharp, sweep, position, ids, vertices, after)


def _judging(options: FairingOptions) -> FairingOptions:
    """Sharp cells and one sigma: places are polished on what they are judged by."""
    return replace(sharp_options(options), robust=replace(options.robust, sigma_rule=("fixed",)))


def _record(
    problem: Problem,
    sweep: SweepState,
    position: SchedulePosition,
    ids: np.ndarray,
    before: np.ndarray,
    after: np.ndarray,
) -> StepRecord:
    """The step of vertices (u,) from one place to the other, if the mean loss around them falls; else they stay."""
    mesh = problem.scene.mesh
    around = np.isin(mesh.faces, ids).max(axis=1)
    here, there = (_judged(problem, sweep, places, around) for places in (before, after))
    all_ids = group_block(mesh, [ids])
    old, new = (float(_losses(sweep, mesh, judged, all_ids)[0]) for judged in (here, there))
    if not new < old:
        there, new = here, old
    record = moved_record(problem, position, sweep.moment, ids, here, there, StepReason.FOUND_TOGETHER)
    moved = (record.after != record.before).any(axis=1)
    reasons = np.where(moved, StepReason.FOUND_TOGETHER, StepReason.NO_BETTER_PLACE).astype(np.int8)
    return replace(record, reasons=reasons, objective_before=old, objective_after=new)


def _searched(
    problem: Problem, start: Start, level: int, vertices: np.ndarray, parent: SweepState, among: np.ndarray
) -> np.ndarray:
    """Vertices (n, 3) after a level's search, if it has one, by those of a mask (n,) alone."""
    radius, origin, places = start.search_radius(level), parent.origin, vertices.copy()
    if radius == 0:
        return places
    sweep = begin_sweep(problem, level, 0, vertices, origin, start.prior(level), radius, among=among)
    for unit in sweep.units:
        places[unit.vertices] = search_around(problem, sweep, unit, places, origin, radius, start.reach).after
    return places


def _refined(
    problem: Problem,
    start: Start,
    level: int,
    vertices: np.ndarray,
    parent: SweepState,
    among: np.ndarray,
    n_sweeps: int,
) -> np.ndarray:
    """Vertices (n, 3) after sweeps of Gauss-Newton at a level by those of a mask (n,) alone."""
    schedule, places = problem.options.schedule, vertices
    for _ in range(n_sweeps):
        sweep = begin_sweep(
            problem,
            level,
            0,
            places,
            parent.origin,
            start.prior(level),
            attraction=start.attraction(level),
            among=among,
        )
        for unit in sweep.units:
            previous, system = None, None
            for iteration in range(by_level(schedule.max_iterations, level)):
                position = SchedulePosition(level, 1, 0, iteration)
                step = gauss_newton_step(problem, sweep, unit, position, places, start.reach, previous, system)
                places, previous, system = step.record.applied_to(places), step.record, step.system
                if step.is_done:
                    break
        if sweep.longest_move(problem.scene, places) < schedule.sweep_tolerance * schedule.blur[level]:
            break
    return places


def fused(problem: Problem, sweep: SweepState, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """(n, 3) float: vertices of the first places, or of the second where these fit better."""
    mesh, gain = problem.scene.mesh, problem.options.schedule.search_gain
    differs = np.linalg.norm(second - first, axis=1) * sweep.pixels_per_unit > MOVED
    result = first.copy()

    def exchange(unit: Block, groups: list[np.ndarray]) -> bool:
        ids = np.concatenate(groups)
        tried = result.copy()
        is_first = (result[ids] == first[ids]).all(axis=1)
        tried[ids] = np.where(is_first[:, None], second[ids], first[ids])
        folded = np.zeros(len(result), dtype=bool)
        folded[mesh.faces[folded_faces(result, tried, problem.start, mesh.faces, problem.options.step)]] = True
        around = np.zeros(len(mesh.faces), dtype=bool)
        around[unit.faces] = True
        here, there = problem.evaluator.map_concurrently(
            lambda places: _losses(sweep, mesh, _judged(problem, sweep, places, around), unit), (result, tried)
        )
        taken = [g for g, a, b in zip(groups, here, there, strict=True) if b < a * (1 - gain) and not folded[g].any()]
        for group in taken:
            result[group] = tried[group]
        return bool(taken)

    groups = connected_groups(mesh, differs)
    if groups:
        exchange(group_block(mesh, groups), groups)
    sets = [ids for ids in independent_sets(mesh, np.flatnonzero(differs)) if len(ids)] if groups else []
    for _ in range(EXCHANGES):
        if not any([exchange(independent_block(mesh, ids), list(ids[:, None])) for ids in sets]):
            break
    return result


def _judged(problem: Problem, sweep: SweepState, vertices: np.ndarray, faces: np.ndarray) -> Judged:
    """Faces of a mask (m,) at given places, on the cells of a problem, by the search's one sigma."""
    context = problem.context_of(faces, sweep.context.level, vertices, problem.options)
    system = problem.evaluator.measure(context, vertices, np.flatnonzero(faces), sweep.scale)
    return Judged(vertices, context, system)


def _losses(sweep: SweepState, mesh: Mesh, judged: Judged, unit: Block) -> np.ndarray:
    """(u,) float: mean loss per photo pixel around each vertex or group of a unit, whose faces were judged."""
    energy = judged.system.energy[np.searchsorted(judged.system.faces, unit.faces)]
    return mean_loss(judged.context, energy, unit, judged.vertices, mesh, sweep.mean_loss)
