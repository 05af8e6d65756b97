"""One iteration of Gauss-Newton for the vertices of a unit: propose, limit, judge; only what lowers the objective is taken."""

from typing import NamedTuple

import numpy as np

from fairing.options import StepOptions
from fairing.run.sweep import SweepState
from fairing.solve.blocks import Block
from fairing.solve.energy import FaceSystem
from fairing.solve.normal_equations import solve_jointly, solve_vertices, vertex_systems
from fairing.solve.problem import Problem
from fairing.trace import SchedulePosition, StepReason, StepRecord

OBJECTIVE_TOLERANCE = 1e-9  # relative: below this two energies are equal


class Iteration(NamedTuple):
    """Attributes:
    record: its next position is its own: what follows is the schedule's to say.
    is_done: no vertex of the unit has farther to go.
    system: normal equations at the new places, where they are known: all vertices were taken there, or none.
    """

    record: StepRecord
    is_done: bool
    system: FaceSystem | None


def gauss_newton_step(
    problem: Problem,
    sweep: SweepState,
    unit: Block,
    position: SchedulePosition,
    vertices: np.ndarray,
    reach: float,
    previous: StepRecord | None,
    system: FaceSystem | None,
) -> Iteration:
    """One iteration.

    Args:
        position: where the step belongs.
        vertices: (n, 3) float: where they are, world units.
        reach: how far from its start a vertex may end, px.
        previous: the unit's previous iteration in this sweep, whose damping goes on.
        system: normal equations at `vertices` where they are known.

    Raises:
        Cancelled: nobody wants it any more.
    """
    options, mesh, ids = problem.options.step, problem.scene.mesh, unit.vertices
    damping, rejections = np.full(len(ids), _usual_damping(options)), np.zeros(len(ids), dtype=np.int64)
    if previous is not None:
        damping, rejections = previous.damping_next, previous.rejections
    is_resting = rejections > options.max_rejections

    system = system or problem.linearise(sweep.context, vertices, unit.faces, unit.corners, sweep.scale)
    H, g = vertex_systems(mesh, system)
    g[ids] += sweep.prior.gradient(vertices, ids)
    if unit.coupled:
        free = np.zeros(len(vertices), dtype=bool)
        free[ids] = True
        proposed = solve_jointly(mesh, system, sweep.prior.blocks, g, free, float(damping.max(initial=0)))[ids]
    else:
        proposed = solve_vertices(H[ids] + sweep.prior.blocks[ids], g[ids], damping)
        proposed[is_resting] = 0

    within_reach = _kept_within(reach, sweep, vertices, ids, problem.shortened(sweep.context, vertices, ids, proposed))
    tried, folds = problem.unfolded(vertices, ids, within_reach)
    step_px = problem.pixels_moved(sweep.context, vertices, ids, tried)
    after = vertices.copy()
    after[ids] += tried
    new_system = problem.linearise(sweep.context, after, unit.faces, unit.corners, sweep.scale)

    old_objective = _objective(sweep, unit, system, vertices)
    new_objective = _objective(sweep, unit, new_system, after)
    if unit.coupled:
        better = np.full(len(ids), new_objective.sum() <= old_objective.sum() * (1 + OBJECTIVE_TOLERANCE))
    else:
        better = new_objective <= old_objective * (1 + OBJECTIVE_TOLERANCE)
    is_still = better & (step_px < options.tolerance)
    reasons = np.where(better, StepReason.ACCEPTED, StepReason.REJECTED_ENERGY).astype(np.int8)
    reasons[is_still] = StepReason.CONVERGED
    reasons[folds & (step_px == 0)] = StepReason.REJECTED_FOLD
    if not unit.coupled:
        reasons[is_resting] = StepReason.RESTING

    better_faces = np.zeros(len(mesh.faces), dtype=bool)
    better_faces[unit.faces] = better[unit.owner]
    is_better_pair = sweep.context.broadcast_to_pairs(better_faces)
    pair_energy_after = np.where(is_better_pair, new_system.pair_energy, system.pair_energy)
    # A vertex at rest proposes to stay, which is never worse: it goes on resting until the sweep ends.
    rejections = np.where(better & ~is_resting, 0, rejections + 1)
    record = StepRecord(
        position=position,
        next_position=position,
        sweep_moment=sweep.moment,
        vertices=ids,
        before=vertices[ids],
        proposed=proposed,
        after=np.where(better[:, None], after[ids], vertices[ids]),
        step_px=step_px,
        damping=damping,
        eigenvalues=np.linalg.eigvalsh(H[ids]),
        reasons=reasons,
        objective_before=float(old_objective.sum()),
        objective_after=float(new_objective.sum()),
        faces=unit.faces,
        face_energy_before=system.energy,
        face_energy_after=np.where(better[unit.owner], new_system.energy, system.energy),
        view_energy_before=sweep.context.sum_by_view(system.pair_energy),
        view_energy_after=sweep.context.sum_by_view(pair_energy_after),
        damping_next=_next_damping(options, damping, better),
        rejections=rejections,
    )
    is_done = is_still | (rejections > options.max_rejections) | (reasons == StepReason.REJECTED_FOLD)
    known = new_system if better.all() else (None if better.any() else system)
    return Iteration(record, bool(is_done.all()), known)


def _kept_within(
    reach: float, sweep: SweepState, vertices: np.ndarray, ids: np.ndarray, steps: np.ndarray
) -> np.ndarray:
    """Steps (u, 3) after which no vertex is farther from its start than `reach`, px, or than it was.

    Where searches look for the vertices' places, what lies farther off is not refined but lost.
    """
    if not np.isfinite(reach):
        return steps
    start = sweep.origin[ids]
    offset = vertices[ids] + steps - start
    within = reach / np.maximum(sweep.pixels_per_unit[ids], 1e-300)
    farthest = np.maximum(within, np.linalg.norm(vertices[ids] - start, axis=1))
    length = np.linalg.norm(offset, axis=1)
    held = start + offset * (farthest / np.maximum(length, 1e-300))[:, None] - vertices[ids]
    return np.where((length > farthest)[:, None], held, steps)


def _objective(sweep: SweepState, unit: Block, system: FaceSystem, vertices: np.ndarray) -> np.ndarray:
    """(u,) float: energy plus prior of each vertex of the unit; where it is coupled, the vertices' shares."""
    energy = np.bincount(unit.owner, weights=system.energy, minlength=len(unit.vertices))
    return energy + sweep.prior.energy(vertices, unit.vertices)


def _usual_damping(options: StepOptions) -> float:
    return options.initial_damping if options.damping_always else 0.0


def _next_damping(options: StepOptions, damping: np.ndarray, better: np.ndarray) -> np.ndarray:
    """(u,) float: ten times more after a rejection, ten times less otherwise, down to the usual one."""
    least = options.initial_damping
    raised = np.maximum(damping * 10, least)
    lowered = np.where(damping > least, damping / 10, _usual_damping(options))
    return np.where(better, lowered, raised)
