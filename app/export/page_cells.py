"""The cells of some faces at a few moments, as pictures for the replay page: I, U c and I - U c, a row a photo."""

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np

from app.cell_images import CellPictures, data_uri
from app.export.run_facts import RunFacts
from fairing.errors import InputError
from fairing.inspect import FaceCells, face_cells
from fairing.options import by_level

ROWS, TILE, GAP = 5, 88, 4
KINDS = ("photo", "reconstruction", "residual")
EMPTY = 36
ALL_FACES = 24  # of a mesh with no more, all are shown
CHOSEN_VERTICES = 5
MOST_FACES = 32
MOMENTS, FEWER_MOMENTS = 10, 6


def chosen_vertices(facts: RunFacts) -> np.ndarray:
    """Ids of vertices by how far they went, the farthest first."""
    way = np.linalg.norm(facts.trace.vertices_at(facts.length) - facts.trace.start, axis=1)
    return np.argsort(-way, kind="stable")


def chosen_faces(facts: RunFacts) -> list[int]:
    """All faces of a small mesh; of a large one those around the vertices that went farthest."""
    mesh = facts.scene.mesh
    if len(mesh.faces) <= ALL_FACES:
        return list(range(len(mesh.faces)))
    faces: list[int] = []
    for vertex in chosen_vertices(facts)[:CHOSEN_VERTICES].tolist():
        faces += [face for face in mesh.one_rings[vertex].tolist() if face not in faces]
    return faces[:MOST_FACES]


def cells_of_faces(facts: RunFacts, on_progress: Callable[[float], None]) -> dict[int, dict[str, Any]]:
    """What the page shows of each chosen face that takes part at some moment."""
    faces = chosen_faces(facts)
    moments = facts.key_moments(MOMENTS if len(faces) <= ALL_FACES else FEWER_MOMENTS)
    found: dict[int, list[FaceCells]] = {face: [] for face in faces}
    for k, moment in enumerate(moments):  # moment by moment: a sweep's photos are blurred once
        for face in faces:
            try:
                cells = face_cells(facts.session, face, moment)
            except InputError:  # behind a camera there: the face has no cells at this moment
                continue
            if cells.takes_part:
                found[face].append(cells)
        on_progress((k + 1) / len(moments))
    return {face: _face(facts, cells) for face, cells in found.items() if cells}


def _face(facts: RunFacts, states: list[FaceCells]) -> dict[str, Any]:
    """Rows stay with their photos, and residuals keep their scale, so that moments compare."""
    views = np.unique(np.concatenate([cells.views for cells in states]))
    views = views[np.unique(np.linspace(0, len(views) - 1, min(ROWS, len(views))).round().astype(int))]
    scale = max(max(float(np.percentile(np.abs(cells.residual[cells.counts]), 99)) for cells in states), 1.0)
    return {
        "names": [facts.scene.views[view].name for view in views],
        "scale": scale,
        "moments": [_moment(facts, cells, views, scale) for cells in states],
    }


def _moment(facts: RunFacts, cells: FaceCells, views: np.ndarray, scale: float) -> dict[str, Any]:
    level = facts.session.sweep_state(cells.moment).context.level
    rows = {int(view): row for row, view in enumerate(cells.views)}
    pictures = CellPictures(cells, residual_scale=scale)
    sheet = np.full((ROWS * (TILE + GAP) - GAP, len(KINDS) * (TILE + GAP) - GAP, 3), EMPTY, dtype=np.uint8)
    energies: list[float | None] = []
    for k, view in enumerate(views.tolist()):
        row = rows.get(view)
        energies.append(None if row is None else float(cells.view_energy[row]))
        for column, kind in enumerate(KINDS if row is not None else ()):
            tile = cv2.resize(pictures.picture(row, kind), (TILE, TILE), interpolation=cv2.INTER_AREA)
            y, x = k * (TILE + GAP), column * (TILE + GAP)
            sheet[y : y + TILE, x : x + TILE] = tile
    return {
        "moment": cells.moment,
        "k": len(cells.basis),
        "blur": by_level(facts.options.schedule.blur, level),
        "energy": cells.energy,
        "energies": energies,
        "picture": data_uri(sheet, jpeg=True),
    }
