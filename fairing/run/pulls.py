"""Pulls: the part of each term of the objective in the step that would be proposed at a moment.

A Gauss-Newton step is -H^-1 (g_1 + ... + g_T) with the damped normal matrix H of all terms. The part of term t is
-H^-1 g_t: one more right-hand side of the same factorization.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.sparse import csc_array

from fairing.optimize.iteration import step_parts
from fairing.optimize.rows import Term
from fairing.run.fit_step import movable
from fairing.run.gauss_newton_step import damping_and_rejections
from fairing.run.records import px_of_steps
from fairing.run.sweep import SweepState
from fairing.solve.blocks import Block
from fairing.solve.energy import FaceSystem
from fairing.solve.normal_equations import solve_jointly, solve_vertices, vertex_systems
from fairing.solve.problem import Problem
from fairing.terms.names import PHOTOS
from fairing.trace import StepRecord


class Pull(NamedTuple):
    """How one term pulls at the vertices.

    Attributes:
        name: of the term, one of `fairing.run.recorded_terms.term_meanings`.
        energy: (n,) float: of the term by vertex. A face counts for each of its corners, as in the vertex curves of the
            debugger, so that the energy is what the vertex's own system minimizes; the sum over the mesh is three times that of
            its faces.
        step: (n, 3) float: part of the proposed step, world units; zero where a vertex does not move in the sweep.
        step_px: (n,) float: its length in the photo where it is longest, px; 0 where no photo sees the vertex.
        information: (n,) float: s^T H_t s of the proposed step s of each vertex, the others fixed, H without damping, energy.
    """

    name: str
    energy: np.ndarray
    step: np.ndarray
    step_px: np.ndarray
    information: np.ndarray


def shares(pulls: list[Pull]) -> np.ndarray:
    """(T, n) float, 0 to 1: share of each term in the information along the step of a vertex, s^T H_t s / s^T H s.

    NaN where there is no step or no information along it.
    """
    return _shares(np.array([pull.information for pull in pulls]))


def shares_of_all(pulls: list[Pull]) -> np.ndarray:
    """(T,) float, 0 to 1: the same for the steps of all vertices together."""
    return _shares(np.array([pull.information.sum() for pull in pulls]))


def _shares(information: np.ndarray) -> np.ndarray:
    total = information.sum(axis=0)
    return np.divide(information, total, out=np.full(information.shape, np.nan), where=total > 0)


def pulls_at(
    problem: Problem,
    sweep: SweepState,
    block: Block | None,
    vertices: np.ndarray,
    previous: StepRecord | None,
    system: FaceSystem | None = None,
) -> list[Pull]:
    """The pulls of all terms of a sweep; their steps add up to the proposed step, before it is limited.

    In a joint order one system solves for all vertices of the sweep. In the other orders each vertex is solved by its own
    3 x 3 system, all others fixed: those of the next step's block with that step's damping, where the ones at rest have no step;
    those of other blocks with the damping of a first iteration, as if their turn came at this moment.

    Args:
        sweep: the sweep of the step.
        block: of the next step; None if the sweep has no next step.
        vertices: (n, 3) float: positions before it, world units.
        previous: the block's previous iteration in the sweep, None where the step is its first.
        system: normal equations of all faces by all corners at `vertices`, if they are known.

    Raises:
        Cancelled: cancellation was requested.
    """
    mesh, n, options = problem.scene.mesh, len(vertices), problem.options.step
    system = system or problem.linearise(sweep.context, vertices, sweep.scale)
    terms, ids = sweep.terms, np.arange(n)
    H_photos, g_photos = vertex_systems(mesh, system)
    hessians = np.stack([H_photos, *(term.hessians(vertices) for term in terms)])  # (T, n, 3, 3), the photos first
    linear = [term.linearise(vertices) for term in terms]
    gradients = np.stack([g_photos, *(each.gradient for each in linear)], axis=-1)  # (n, 3, T)
    moves = np.zeros(n, dtype=bool)
    for each in sweep.blocks:
        moves[each.vertices] = True
    damping, rejections = damping_and_rejections(options, ids, None)
    if block is not None:
        own = block.vertices
        damping[own], rejections[own] = damping_and_rejections(options, own, previous)
    if any(each.coupled for each in sweep.blocks):
        others = sum((each.matrix for each in linear), csc_array((3 * n, 3 * n)))
        parts = solve_jointly(mesh, system, others, gradients, moves, float(damping[moves].max()))
    else:
        moves &= rejections <= options.max_rejections
        parts = np.zeros(gradients.shape)
        parts[moves] = solve_vertices(hessians.sum(axis=0)[moves], gradients[moves], damping[moves])
    around = np.bincount(mesh.faces[system.faces].ravel(), weights=np.repeat(system.energy, 3), minlength=n)
    energies = [around, *(term.by_vertex(vertices) for term in terms)]
    names, steps, whole = [PHOTOS, *(term.name for term in terms)], np.moveaxis(parts, -1, 0), parts.sum(axis=-1)
    px = [problem.pixels_moved(sweep.context, vertices, ids, step) for step in steps]
    # A quadratic form may come out below zero by rounding.
    information = np.maximum(np.einsum("vi,tvij,vj->tv", whole, hessians, whole), 0)
    return [Pull(*each) for each in zip(names, energies, steps, px, information, strict=True)]


def pulls_of_fit(problem: Problem, terms: Sequence[Term], vertices: np.ndarray) -> list[Pull]:
    """The pulls of the terms of a fit at vertices (n, 3) float, world units; their steps add up to the proposed step."""
    parts, ids = step_parts(terms, vertices, movable(problem, vertices)), np.arange(len(vertices))
    whole, pulls = parts.sum(axis=-1), []
    for term, step in zip(terms, np.moveaxis(parts, -1, 0), strict=True):
        information = np.maximum(np.einsum("vi,vij,vj->v", whole, term.hessians(vertices), whole), 0)
        px = px_of_steps(problem, vertices, ids, step)
        pulls.append(Pull(term.name, term.by_vertex(vertices), step, px, information))
    return pulls
