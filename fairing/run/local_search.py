"""Local search: tries positions around each vertex, with the visibility each face would have there.

Gauss-Newton finds the nearest minimum. Small faces with distant vertices lie outside its basin of attraction, and the
photos that see such a face at its wrong position differ from those that see it at the true one. So every position tried
is evaluated by the photos that would see the faces there, as a loss per photo pixel. (ledger: local search)

A group of vertices that are wrong together is not escaped by moving one
vertex at a time: see `fairing.run.restart`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np

from fairing.cells.context import CellContext
from fairing.geometry.normals import folded_faces
from fairing.solve.blocks import Block
from fairing.solve.energy import FaceSystem
from fairing.solve.face_loss import mean_loss
from fairing.solve.normal_equations import solve_vertices, vertex_systems
from fairing.solve.problem import Problem
from fairing.work import Work

REFINEMENT_DAMPING = 1e-3

ContextAt = Callable[[np.ndarray, np.ndarray], CellContext]
"""Cells and visibility with the vertices at given positions (n, 3), of the faces of a mask (m,)."""


class SearchRegion(NamedTuple):
    """Where the u vertices of a block are searched.

    Attributes:
        origin: (n, 3) float: positions at the start of the run or after a manual edit, world units.
        radius: (u,) float: distance of the positions tried, world units.
        bound: (u,) float: largest distance of a vertex from its origin afterwards, world units.
    """

    origin: np.ndarray
    radius: np.ndarray
    bound: np.ndarray


@dataclass(frozen=True, eq=False)
class SearchResult:
    """Result of a search for the u vertices of a block.

    Attributes:
        after: (u, 3) float: the better positions, or the old ones, world units.
        proposed: (u, 3) float: displacements to the best positions tried, world units.
        score_before, score_after: (u,) float: mean loss per photo pixel around each vertex, at the old position and at
            `after`.
        folds: (u,) bool: the better position would have folded a face.
        system_before, system_after: energies of the faces of the block at the old and the new positions.
        context_before, context_after: visibility and cells there.
    """

    after: np.ndarray
    proposed: np.ndarray
    score_before: np.ndarray
    score_after: np.ndarray
    folds: np.ndarray
    system_before: FaceSystem
    system_after: FaceSystem
    context_before: CellContext
    context_after: CellContext


def search_directions() -> np.ndarray:
    """(8, 3) float, unit length: the space diagonals (ledger: directions of a search)."""
    return np.array(list(product((-1, 1), repeat=3))) / np.sqrt(3)


def search_block(
    problem: Problem,
    block: Block,
    vertices: np.ndarray,
    region: SearchRegion,
    context_at: ContextAt,
    steps: int,
    scale: np.ndarray,
    unseen_loss: float,
    work: Work,
) -> SearchResult:
    """Try positions around the vertices of an independent block.

    Args:
        vertices: (n, 3) float: positions now, world units.
        region: where to search.
        context_at: the cells that each position is refined and evaluated on.
        steps: Gauss-Newton steps that refine a position before it is evaluated.
        scale: (m,) float: of the robust loss, by face.
        unseen_loss: loss per photo pixel of a face that fewer than three photos see.
        work: its parts are the directions, and first the present positions.

    Raises:
        Cancelled: cancellation was requested.
    """
    mesh, options, evaluator, origin = problem.scene.mesh, problem.options, problem.evaluator, region.origin
    ids = block.vertices
    around = np.zeros(len(mesh.faces), dtype=bool)
    around[block.faces] = True

    def score(context: CellContext, energy: np.ndarray, places: np.ndarray) -> np.ndarray:
        return mean_loss(context, energy, block, places, mesh, unseen_loss)

    def refine(context: CellContext, places: np.ndarray) -> np.ndarray:
        """Move the vertices of the block in `places`; returns the energies (F,) of its faces there."""
        solver = options.step.solver
        system = evaluator.linearise(context, places, block.faces, block.corners, scale, solver)
        energy, improving = system.energy, np.ones(len(ids), dtype=bool)
        for step in range(steps):
            H, g = vertex_systems(mesh, system)
            damping = np.full(len(ids), REFINEMENT_DAMPING)
            move = problem.shortened(context, places, ids, solve_vertices(H[ids], g[ids], damping))
            refined = places.copy()
            refined[ids] += np.where(improving[:, None], move, 0.0)
            _undo_folds(problem, places, refined, origin, ids)
            tried = np.flatnonzero(improving[block.owner])
            faces, corners = block.faces[tried], block.corners[tried]
            if step + 1 < steps:
                system = evaluator.linearise(context, refined, faces, corners, scale, solver)
            else:
                system = evaluator.energies(context, refined, faces, scale)
            trial = energy.copy()
            trial[tried] = system.energy
            # A vertex that does not improve would take the same step again: it stays, and its faces are not evaluated again.
            improving = _by_owner(block, trial) < _by_owner(block, energy)
            places[ids[improving]] = refined[ids[improving]]
            energy = np.where(improving[block.owner], trial, energy)
        return energy

    before = context_at(vertices, around)
    system_before = evaluator.energies(before, vertices, block.faces, scale)
    score_before = score(before, system_before.energy, vertices)

    def tried(direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Refined positions (u, 3) in a direction from the present ones, and their scores (u,)."""
        places = vertices.copy()
        offset = vertices[ids] + region.radius[:, None] * direction - origin[ids]
        length = np.linalg.norm(offset, axis=1)
        places[ids] = origin[ids] + offset * np.minimum(1, region.bound / np.maximum(length, 1e-300))[:, None]
        _undo_folds(problem, vertices, places, origin, ids)
        context = context_at(places, around) if direction.any() else before
        face_energy = refine(context, places)
        return places[ids], score(context, face_energy, places)

    threshold = score_before * (1 - options.schedule.search_gain)
    best_score, best = threshold, vertices[ids].copy()
    directions = np.vstack([np.zeros(3), search_directions()])
    for found, found_score in evaluator.map_concurrently(work.counted(tried), directions):
        improved = found_score < best_score
        best[improved] = found[improved]
        best_score = np.where(improved, found_score, best_score)

    proposed = best - vertices[ids]
    places = vertices.copy()
    places[ids] = best
    folds = _undo_folds(problem, vertices, places, origin, ids)
    # The refined position is evaluated once more by the photos that see it there.
    after_context = context_at(places, around)
    system_after = evaluator.energies(after_context, places, block.faces, scale)
    score_after = score(after_context, system_after.energy, places)
    worse = ~(score_after < threshold)
    places[ids[worse]] = vertices[ids[worse]]
    kept_faces = worse[block.owner]
    system_after.energy[kept_faces] = system_before.energy[kept_faces]
    return SearchResult(
        places[ids], proposed, score_before, np.where(worse, score_before, score_after), folds, system_before,
        system_after, before, after_context,
    )  # fmt: skip


def _by_owner(block: Block, values: np.ndarray) -> np.ndarray:
    return np.bincount(block.owner, weights=values, minlength=len(block.vertices))


def _undo_folds(
    problem: Problem, before: np.ndarray, places: np.ndarray, origin: np.ndarray, ids: np.ndarray
) -> np.ndarray:
    """Reset the vertices of folded faces in `places` (n, 3) to `before` (n, 3); returns (u,) bool: which of `ids`."""
    faces = problem.scene.mesh.faces
    folded = folded_faces(before, places, origin, faces, problem.options.step)
    hit = np.isin(ids, faces[folded])
    places[ids[hit]] = before[ids[hit]]
    return hit
