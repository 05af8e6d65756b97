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
    """What the page shows of each chosen face that takes part at the start or at the end.

    Cells are many megabytes at the finest level, so each is made a picture of before the next is looked at. Moments are the
    outer loop: a sweep's photos are blurred once.
    """
    faces, is_small = chosen_faces(facts), len(facts.trace.faces) <= ALL_FACES
    moments = facts.key_moments(MOMENTS if is_small else FEWER_MOMENTS)
    ends = sorted({0, facts.length})
    views: dict[int, set[int]] = {face: set() for face in faces}
    scales = dict.fromkeys(faces, 1.0)
    found: dict[int, list[dict[str, Any]]] = {face: [] for face in faces}
    for k, moment in enumerate([*ends, *moments]):
        for face in faces:
            cells = _cells(facts, face, moment)
            if cells is None:
                continue
            if k < len(ends):
                views[face].update(cells.views.tolist())
                scales[face] = max(scales[face], float(np.percentile(np.abs(cells.residual[cells.counts]), 99)))
            elif views[face]:
                found[face].append(_moment(facts, cells, _rows(views[face]), scales[face]))
        on_progress((k + 1) / (len(ends) + len(moments)))
    return {
        face: {
            "names": [facts.scene.views[view].name for view in _rows(views[face])],
            "scale": scales[face],
            "moments": entries,
        }
        for face, entries in found.items()
        if entries
    }


def _cells(facts: RunFacts, face: int, moment: int) -> FaceCells | None:
    """None where the face takes no part, or has a corner behind a camera."""
    try:
        cells = face_cells(facts.session, face, moment)
    except InputError:
        return None
    return cells if cells.takes_part and cells.counts.any() else None


def _rows(views: set[int]) -> list[int]:
    """The photos shown, spread evenly, the same at all moments, so that moments compare."""
    ordered = sorted(views)
    places = np.unique(np.linspace(0, len(ordered) - 1, min(ROWS, len(ordered))).round().astype(int))
    return [ordered[place] for place in places]


def _moment(facts: RunFacts, cells: FaceCells, views: list[int], scale: float) -> dict[str, Any]:
    level = facts.session.sweep_state(cells.moment).context.level
    rows = {int(view): row for row, view in enumerate(cells.views)}
    pictures = CellPictures(cells, residual_scale=scale)
    sheet = np.full((ROWS * (TILE + GAP) - GAP, len(KINDS) * (TILE + GAP) - GAP, 3), EMPTY, dtype=np.uint8)
    energies: list[float | None] = []
    for k, view in enumerate(views):
        row = rows.get(view)
        energies.append(None if row is None else float(cells.view_energy[row]))
        if row is None:
            continue
        for column, kind in enumerate(KINDS):
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
