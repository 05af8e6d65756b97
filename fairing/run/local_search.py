"""Before Gauss-Newton: look around each vertex for a better place, judged with the visibility it would have there.

Gauss-Newton finds the minimum near by. On buildings, faces of 20 px with vertices 8 px off their corner lie outside
its reach, and the photos that seem to see a face are those that see it in its wrong place: then the truth costs more
than the error. So every place tried is judged by the photos that would see the faces there, per photo area. Measured
on the facade (median / rms of the determined error in % of the diagonal, from 0.73 / 0.66): Gauss-Newton alone 0.23 /
0.70; search with visibility kept as it was 0.09 / 0.82; with the visibility of each place 0.10 / 0.44, and 0.085 /
0.34 when no vertex may leave the search's reach.

Blurred cells mistake places for each other: of the 56 vertices that ended farthest off there, 20 had a lower loss in
the wrong place at blur 1.2, but 5 at blur 0.5 with photos equally sharp. So at the finest level places are polished on
blurred cells and judged on sharp ones (determined rms at the end 0.368 -> 0.333; a second such search 0.331, a third 0.333).
What is wrong together no single vertex can leave: see `restart`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np

from fairing.cells.context import CellContext
from fairing.geometry.normals import face_normals, folded_faces
from fairing.mesh import Mesh
from fairing.options import FairingOptions
from fairing.solve.blocks import Block
from fairing.solve.energy import Evaluator, FaceSystem
from fairing.solve.normal_equations import solve_vertices, vertex_systems

POLISH_DAMPING = 1e-3

ContextAt = Callable[[np.ndarray, np.ndarray], CellContext]
"""Cells and visibility at given vertices (n, 3), for the faces of a mask (m,)."""


class Stage(NamedTuple):
    """Gauss-Newton steps that polish a place before it is judged, on cells of one kind."""

    context_at: ContextAt
    steps: int


def search_directions() -> np.ndarray:
    """(14, 3) float, unit length: the axes and the space diagonals."""
    corners = np.array([c for c in product((-1, 0, 1), repeat=3) if sum(map(abs, c)) in (1, 3)], dtype=float)
    return corners / np.linalg.norm(corners, axis=1, keepdims=True)


@dataclass(frozen=True, eq=False)
class Found:
    """What a search found for the u vertices of a unit.

    Attributes:
        after: (u, 3) float: the better place, or the old one.
        proposed: (u, 3) float: displacement to the best place tried.
        score_before, score_after: (u,) float: mean loss per photo pixel around the vertex, at the old place and at
        `after`.
        folds: (u,) bool: the better place would have folded a face.
        system_before, system_after: energies of the unit's faces at the old and the new places.
        context_before, context_after: who sees them there.
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


def search_block(
    unit: Block,
    vertices: np.ndarray,
    start: np.ndarray,
    radius: np.ndarray,
    bound: np.ndarray,
    unseen_loss: float,
    scale: np.ndarray,
    mesh: Mesh,
    options: FairingOptions,
    evaluator: Evaluator,
    stages: list[Stage],
    limit: Callable[[CellContext, np.ndarray, np.ndarray, np.ndarray], np.ndarray],
) -> Found:
    """Try places around the vertices of an independent unit, each polished by two Gauss-Newton steps.

    Args:
        vertices, start: (n, 3) float: positions now and at the start of the run (or where a hand put them), world units.
        radius: (u,) float: how far away the places lie, world units.
        bound: (u,) float: how far from its start a vertex may end, world units.
        unseen_loss: what a face costs per photo pixel that no three photos see: as much as the mesh's average.
        scale: (m,) float: of the robust norm, by face.
        stages: how places are polished; they are judged on the cells of the last one.
        limit: shortens steps (u, 3) of the unit's vertices to the capture range.
    """
    ids = unit.vertices
    judged = np.zeros(len(mesh.faces), dtype=bool)
    judged[unit.faces] = True

    def score(context: CellContext, energy: np.ndarray, places: np.ndarray) -> np.ndarray:
        return mean_loss(context, energy, unit, places, mesh, unseen_loss)

    def linearise(context: CellContext, places: np.ndarray) -> FaceSystem:
        return evaluator.linearise(context, places, unit.faces, unit.corners, scale, options.step.solver)

    def polish(context: CellContext, places: np.ndarray, steps: int) -> np.ndarray:
        """Move the unit's vertices in `places`; the faces' energies there."""
        system = linearise(context, places)
        face_energy = system.energy
        for step in range(steps):
            H, g = vertex_systems(mesh, system)
            move = limit(context, places, ids, solve_vertices(H[ids], g[ids], np.full(len(ids), POLISH_DAMPING)))
            polished = places.copy()
            polished[ids] += move
            _undo_folds(places, polished, start, mesh, ids, options)
            trial = linearise(context, polished)
            better = _by_owner(unit, trial.energy) < _by_owner(unit, face_energy)
            places[ids[better]] = polished[ids[better]]
            face_energy = np.where(better[unit.owner], trial.energy, face_energy)
            if step + 1 < steps:
                system = trial if better.all() else linearise(context, places)
        return face_energy

    judging = stages[-1]
    before = judging.context_at(vertices, judged)
    system_before = evaluator.measure(before, vertices, unit.faces, scale)
    score_before = score(before, system_before.energy, vertices)

    def tried(direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Places (u, 3) in a direction from the present ones, polished, and their scores (u,)."""
        places = vertices.copy()
        offset = vertices[ids] + radius[:, None] * direction - start[ids]
        length = np.linalg.norm(offset, axis=1)
        places[ids] = start[ids] + offset * np.minimum(1, bound / np.maximum(length, 1e-300))[:, None]
        _undo_folds(vertices, places, start, mesh, ids, options)
        context, face_energy = before, system_before.energy
        for stage in stages:
            stays = stage is judging and len(stages) == 1 and not direction.any()
            context = before if stays else stage.context_at(places, judged)
            face_energy = polish(context, places, stage.steps)
        return places[ids], score(context, face_energy, places)

    best_score, best = score_before * (1 - options.schedule.search_gain), vertices[ids].copy()
    for reached, reached_score in evaluator.map_concurrently(tried, np.vstack([np.zeros(3), search_directions()])):
        improved = reached_score < best_score
        best[improved] = reached[improved]
        best_score = np.where(improved, reached_score, best_score)

    proposed = best - vertices[ids]
    places = vertices.copy()
    places[ids] = best
    folds = _undo_folds(vertices, places, start, mesh, ids, options)
    # The polished place is judged once more by the photos that see it there.
    after_context = judging.context_at(places, judged)
    system_after = evaluator.measure(after_context, places, unit.faces, scale)
    score_after = score(after_context, system_after.energy, places)
    worse = ~(score_after < score_before * (1 - options.schedule.search_gain))
    places[ids[worse]] = vertices[ids[worse]]
    kept_faces = worse[unit.owner]
    system_after.energy[kept_faces] = system_before.energy[kept_faces]
    return Found(
        places[ids], proposed, score_before, np.where(worse, score_before, score_after), folds, system_before,
        system_after, before, after_context,
    )  # fmt: skip


def _by_owner(unit: Block, values: np.ndarray) -> np.ndarray:
    return np.bincount(unit.owner, weights=values, minlength=len(unit.vertices))


def mean_loss(
    context: CellContext, energy: np.ndarray, unit: Block, vertices: np.ndarray, mesh: Mesh, unseen_loss: float
) -> np.ndarray:
    """(u,) float: mean loss per photo pixel of the faces around each vertex.

    Args:
        energy: (F,) float: of the unit's faces.
        unseen_loss: of a face that fewer than three photos see: the mesh's average. It counts half.
    """
    faces = unit.faces
    loss, pixels = loss_of_faces(context, energy, faces)
    seen = pixels > 0
    loss[~seen] = unseen_loss
    surface = np.linalg.norm(face_normals(vertices, mesh.faces[faces]), axis=1)
    area = np.where(seen, context.footprint_area[faces], 0)
    pixels_per_surface = _by_owner(unit, area) / np.maximum(_by_owner(unit, np.where(seen, surface, 0)), 1e-300)
    weight = np.where(seen, area, 0.5 * surface * pixels_per_surface[unit.owner])
    weighed = _by_owner(unit, weight)
    return np.where(weighed > 0, _by_owner(unit, weight * loss) / np.maximum(weighed, 1e-300), unseen_loss)


def loss_of_faces(context: CellContext, energy: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Loss of faces (F,) per photo pixel, and their pixels in all photos; both 0 where fewer than three photos see one.

    Divided by the degrees of freedom, (n - k) / n, so that few photos do not look like a good fit.
    """
    data = context.kernel
    samples = np.diff(data.grid_start)[data.face_grid]
    views = np.diff(data.pair_start)
    total = np.concatenate([[0], np.cumsum(data.pair_weight * np.repeat(samples, views))])
    pixels = (total[data.pair_start[1:]] - total[data.pair_start[:-1]])[faces]
    k, n = data.face_dimensions[faces], views[faces]
    pixels[k == 0] = 0
    return np.where(k > 0, energy / np.maximum(pixels, 1e-12) * n / np.maximum(n - k, 1), 0.0), pixels


def _undo_folds(
    before: np.ndarray, places: np.ndarray, start: np.ndarray, mesh: Mesh, ids: np.ndarray, options: FairingOptions
) -> np.ndarray:
    """Put vertices of folded faces back in `places`; tells which of `ids`."""
    folded = folded_faces(before, places, start, mesh.faces, options.step)
    hit = np.isin(ids, mesh.faces[folded])
    places[ids[hit]] = before[ids[hit]]
    return hit
