"""One Gauss-Newton iteration of a block: propose steps, limit them, accept those that do not raise the objective."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fairing.optimize.iteration import OBJECTIVE_TOLERANCE
from fairing.optimize.rows import Term, linearised_sum
from fairing.options import StepOptions
from fairing.run.records import Measured, build_record
from fairing.run.sweep import SweepState
from fairing.solve.blocks import Block
from fairing.solve.energy import FaceSystem
from fairing.solve.normal_equations import solve_jointly, solve_vertices, vertex_systems
from fairing.solve.problem import Problem
from fairing.trace import SchedulePosition, StepReason, StepRecord


class Iteration(NamedTuple):
    """Result of an iteration.

    Attributes:
        record: its next position is its own; the schedule replaces it.
        is_done: whether every vertex of the block has converged or is at rest.
        system: normal equations at the new positions; None after the last iteration of a block.
    """

    record: StepRecord
    is_done: bool
    system: FaceSystem | None


class Proposal(NamedTuple):
    """The step that an iteration tries, and what it is computed from; u vertices of the block.

    Attributes:
        system: normal equations of the photos at the positions before the step.
        terms: what of the terms beside the photos depends on the block.
        hessians: (u, 3, 3) float: normal matrices of the vertices from the photos alone, energy / world unit^2.
        gradients: (u, 3) float: of all terms, energy / world unit.
        damping: (u,) float, relative.
        rejections: (u,) int: consecutive ones so far.
        proposed: (u, 3) float: the solution, world units.
        shortened: (u, 3) float: shortened to the longest step in a photo.
        tried: (u, 3) float: further shortened until no face folds; the step that is accepted or rejected.
        folds: (u,) bool: whether a face would have folded.
    """

    system: FaceSystem
    terms: list[Term]
    hessians: np.ndarray
    gradients: np.ndarray
    damping: np.ndarray
    rejections: np.ndarray
    proposed: np.ndarray
    shortened: np.ndarray
    tried: np.ndarray
    folds: np.ndarray


def propose(
    problem: Problem,
    sweep: SweepState,
    block: Block,
    vertices: np.ndarray,
    previous: StepRecord | None,
    system: FaceSystem | None,
) -> Proposal:
    """The step of a block, before its energy is known.

    Args:
        sweep: the sweep of the step.
        vertices: (n, 3) float: positions before it, world units.
        previous: the block's previous iteration in this sweep, whose damping is continued.
        system: normal equations of the block's faces at `vertices` if they are known.

    Raises:
        Cancelled: cancellation was requested.
    """
    options, mesh, ids = problem.options.step, problem.scene.mesh, block.vertices
    damping, rejections = damping_and_rejections(options, ids, previous)
    system = system or problem.linearise(sweep.context, vertices, sweep.scale, block.faces, block.corners)
    H, g = vertex_systems(mesh, system)
    terms = [*sweep.terms] if block.coupled else [term.around(ids) for term in sweep.terms]
    others = linearised_sum(terms, vertices)
    g += others.gradient
    if block.coupled:
        free = np.zeros(len(vertices), dtype=bool)
        free[ids] = True
        proposed = solve_jointly(mesh, system, others.matrix, g, free, float(damping.max(initial=0)))[ids]
    else:
        own = sum((term.hessians(vertices)[ids] for term in terms), H[ids])
        proposed = solve_vertices(own, g[ids], damping)
        proposed[rejections > options.max_rejections] = 0
    shortened = problem.shortened(sweep.context, vertices, ids, proposed)
    tried, folds = problem.unfolded(vertices, ids, shortened)
    return Proposal(system, terms, H[ids], g[ids], damping, rejections, proposed, shortened, tried, folds)


def judge(
    problem: Problem,
    sweep: SweepState,
    block: Block,
    position: SchedulePosition,
    vertices: np.ndarray,
    proposal: Proposal,
) -> Iteration:
    """Accept or reject a proposal, by the objective of each vertex; in a coupled block by that of all.

    Args:
        position: of the step.
        vertices: (n, 3) float: positions before it, world units.

    Raises:
        Cancelled: cancellation was requested.
    """
    options, mesh, ids = problem.options.step, problem.scene.mesh, block.vertices
    system, tried, folds, damping = proposal.system, proposal.tried, proposal.folds, proposal.damping
    rejections = proposal.rejections
    is_resting = rejections > options.max_rejections
    step_px = problem.pixels_moved(sweep.context, vertices, ids, tried)
    after = vertices.copy()
    after[ids] += tried
    is_last = position.iteration + 1 >= sweep.stage.max_iterations
    new_system = (
        problem.energies(sweep.context, after, sweep.scale, block.faces)
        if is_last
        else problem.linearise(sweep.context, after, sweep.scale, block.faces, block.corners)
    )

    old_objective = _objective(proposal.terms, block, system, vertices)
    new_objective = _objective(proposal.terms, block, new_system, after)
    if block.coupled:
        accepted = np.full(len(ids), new_objective.sum() <= old_objective.sum() * (1 + OBJECTIVE_TOLERANCE))
    else:
        accepted = new_objective <= old_objective * (1 + OBJECTIVE_TOLERANCE)
    has_converged = accepted & (step_px < options.tolerance)
    reasons = np.where(accepted, StepReason.ACCEPTED, StepReason.REJECTED_ENERGY)
    reasons[has_converged] = StepReason.CONVERGED
    reasons[folds & (step_px == 0)] = StepReason.REJECTED_FOLD
    if not block.coupled:
        reasons[is_resting] = StepReason.RESTING

    accepted_faces = np.zeros(len(mesh.faces), dtype=bool)
    accepted_faces[block.faces] = accepted[block.owner]
    taken = system.replaced_by(new_system, accepted[block.owner], sweep.context.broadcast_to_pairs(accepted_faces))
    # A vertex at rest proposes a zero step, which is always accepted: it stays at rest until the sweep ends.
    rejections = np.where(accepted & ~is_resting, 0, rejections + 1)
    after[ids[~accepted]] = vertices[ids[~accepted]]
    measured = Measured(sweep.context, system), Measured(sweep.context, taken)
    record = replace(
        build_record(
            problem, position, sweep.moment, ids, vertices, after, reasons, measured=measured, step_px=step_px
        ),
        proposed=proposal.proposed,
        objective_before=float(old_objective.sum()),
        objective_after=float(new_objective.sum()),
        damping=damping,
        eigenvalues=np.linalg.eigvalsh(proposal.hessians),
        damping_next=_next_damping(options, damping, accepted),
        rejections=rejections,
    )
    is_done = has_converged | (rejections > options.max_rejections) | (reasons == StepReason.REJECTED_FOLD)
    return Iteration(record, bool(is_done.all()), None if is_last else taken)


def damping_and_rejections(
    options: StepOptions, ids: np.ndarray, previous: StepRecord | None
) -> tuple[np.ndarray, np.ndarray]:
    """Damping (u,) float of the next step of vertices `ids` (u,) int, and their consecutive rejections so far (u,) int.

    Args:
        previous: the previous iteration of a block of these vertices in the sweep; None: the step is its first.
    """
    if previous is not None:
        return previous.damping_next, previous.rejections
    return np.full(len(ids), _usual_damping(options)), np.zeros(len(ids), dtype=np.int64)


def _objective(terms: list[Term], block: Block, system: FaceSystem, vertices: np.ndarray) -> np.ndarray:
    """(u,) float: energy of all terms around each vertex of the block; in a coupled block their sum is that of the mesh."""
    energy = np.bincount(block.owner, weights=system.energy, minlength=len(block.vertices))
    if block.coupled:
        return energy + sum(term.total(vertices) for term in terms) / len(energy)
    return energy + sum(term.by_vertex(vertices)[block.vertices] for term in terms)


def _usual_damping(options: StepOptions) -> float:
    return options.initial_damping if options.damping_always else 0.0


def _next_damping(options: StepOptions, damping: np.ndarray, accepted: np.ndarray) -> np.ndarray:
    """(u,) float: ten times the damping after a rejection, a tenth after acceptance, down to the usual value."""
    least = options.initial_damping
    raised = np.maximum(damping * 10, least)
    lowered = np.where(damping > least, damping / 10, _usual_damping(options))
    return np.where(accepted, lowered, raised)
