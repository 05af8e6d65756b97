"""Data of a lesson page: the scene with its photos, the record and cells of each run, and the steps of the lesson."""

import base64
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np

from app.debugger.cell_queries import CellQuery, StepFlows, cell_facts
from app.debugger.energy_profile import REACH, energy_profile
from app.export.packing import packed
from app.export.page_cells import ALL_FACES, cells_of_runs
from app.export.page_data import packed_keyframe, run_data, scene_data
from app.export.run_facts import RunFacts
from app.export.texture_keyframes import texture_keyframes
from app.layers.certainty import ellipsoid_lines
from app.lesson_pages.playing import PlayedLesson, PlayedStep
from app.lesson_pages.texts import step_texts
from app.page_state.cells_state import ARROW_KINDS, DIFFERENCE, HEADS, KINDS, CellsView
from app.page_state.certainty_source import drawn_half_axis
from app.page_state.page_state import ASSOCIATIONS, LAYERS, PageState
from app.palette import AXIS_CURVES, REFERENCE, css
from app.panels.legend import legend_html
from app.pictures.cell_images import MIN_CONFIDENCE
from app.pictures.coloring import COLORINGS, color_mesh
from fairing.judge.certainty import certainties
from fairing.run.recorded_terms import term_meanings
from fairing.scene import Scene

JPEG_QUALITY = 85
KEYFRAMES = 5
TEXELS = 1024
PLACE_UNIT = 1 / 64  # cell pixels: the unit of arrows in the file


def lesson_data(played: PlayedLesson, on_progress: Callable[[float], None]) -> dict[str, Any]:
    """All data that the scripts of the page read.

    Args:
        on_progress: called with the fraction that is done.
    """
    runs = [run.facts for run in played.runs]
    scene, stage = played.scene, runs[0].stage
    reach = REACH * _shortest_edge(scene)
    cells, photos = cells_of_runs(runs, lambda fraction: on_progress(0.6 * fraction), reach)
    steps = [_step(played, n) for n in range(len(played.steps))]
    on_progress(0.8)
    found = [
        {
            "name": played.runs[n].name,
            "title": facts.title,
            **run_data(facts),
            "isFinished": facts.session.finished,
            "cells": cells[n],
            "keyframes": _keyframes(played, n),
            "off": _errors_of_vertices(facts),
        }
        for n, facts in enumerate(runs)
    ]
    on_progress(1.0)
    data = scene_data(runs[0])
    data["colors"] |= {"reference": REFERENCE}
    data["stage"] |= {
        "mesh": (stage.eye - stage.target).tolist(),
        "front": (stage.frontal() - stage.target).tolist(),
        "pageFromWorld": float(stage.scale),
    }
    return data | {
        "lesson": {"title": played.lesson.title, "about": played.lesson.about, "name": played.lesson.name},
        "isCube": played.lesson.scene.endswith("cube"),
        "photos": photos | {"views": _with_pictures(scene, photos["views"])},
        "runs": found,
        "steps": steps,
        "reach": reach * stage.scale,
        "kinds": {name: {"head": HEADS[name], "meaning": KINDS[name]} for name in KINDS},
        "difference": DIFFERENCE,
        "layers": {name: title for name, title in LAYERS.items() if name not in (*ASSOCIATIONS, "pulls")},
        "curves": [css(color) for color in AXIS_CURVES],
    }


def _errors_of_vertices(facts: RunFacts) -> dict[str, str] | None:
    """(moments, n) float32: distance of every vertex of a small mesh from its true position, hundredths of a world unit.

    The positions in the file are rounded, which changes the digits of a small error.
    """
    scene, trace = facts.scene, facts.trace
    known = None if scene.truth is None else scene.truth.vertices
    if known is None or len(scene.mesh.faces) > ALL_FACES:
        return None
    off = [np.linalg.norm(trace.vertices_at(moment) - known, axis=1) for moment in range(facts.length + 1)]
    return packed((100 * np.array(off)).astype(np.float32))


def _shortest_edge(scene: Scene) -> float:
    """Of the true mesh if it is known, world units."""
    known = None if scene.truth is None else scene.truth.vertices
    ends = (scene.mesh.vertices if known is None else known)[scene.mesh.edges]
    return float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).min())


def _with_pictures(scene: Scene, views: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The photos with their pictures in colour, for texture, crops and views through a camera."""
    return [found | {"picture": _jpeg(view.photo.load())} for view, found in zip(scene.views, views, strict=True)]


def _jpeg(pixels: np.ndarray) -> str:
    _, encoded = cv2.imencode(".jpg", pixels[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return "data:image/jpeg;base64," + base64.b64encode(encoded.tobytes()).decode()


def _keyframes(played: PlayedLesson, run: int) -> list[dict[str, Any]]:
    """Textures of a large mesh. A small mesh is textured by the page, from the photos, so that its vertices can be moved."""
    facts = played.runs[run].facts
    if len(facts.scene.mesh.faces) <= ALL_FACES:
        return []
    moments = sorted({0, facts.length, *(step.moment for step in played.steps if step.run == run)})
    chosen = sorted({moments[k] for k in np.linspace(0, len(moments) - 1, KEYFRAMES).round().astype(int)})
    return [packed_keyframe(frame) for frame in texture_keyframes(facts, chosen, TEXELS, lambda fraction: None)]


# ---------------------------------------------------------------------- steps


def _step(played: PlayedLesson, n: int) -> dict[str, Any]:
    step = played.steps[n]
    page_state = PageState()
    step.settings.set_in(page_state)
    facts = played.runs[step.run].facts
    cells_view = page_state.cells
    return step_texts(played.lesson.steps[n], step.findings) | {
        "run": step.run,
        "moment": step.moment,
        "compared": step.compared,
        "vertices": list(page_state.selection.vertices),
        "face": page_state.face,
        "eye": step.settings.eye,
        "heading": step.settings.heading,
        "surface": page_state.surface,
        "shape": page_state.shape,
        "magnification": page_state.magnification,
        "shown": page_state.shown,
        "cells": _cells_view(cells_view),
        "experiment": step.settings.settings.get("experiment") if step.settings.tab == "Experiments" else None,
        "certainty": _ellipsoids(facts, step, page_state),
        "axes": _axes(facts, step, page_state),
        "coloring": _coloring(facts, step, page_state),
        "flows": _flows(facts, step, page_state),
        "profile": _profile(facts, step, page_state),
    }


def _cells_view(cells_view: CellsView) -> dict[str, Any]:
    return {
        "page": cells_view.page,
        "columns": list(cells_view.columns),
        "arrows": cells_view.arrow_scale,
        "span": cells_view.span,
        "pair": list(cells_view.pair),
        "dimensions": cells_view.dimensions,
    }


def _ellipsoids(facts: RunFacts, step: PlayedStep, page_state: PageState) -> dict[str, str] | None:
    """Line segments (n, 2, 3), page units, of the certainty ellipsoids of the selected vertices; None if they are hidden."""
    chosen = page_state.selection.vertices
    if not page_state.shows("certainty") or not chosen:
        return None
    vertices, mesh = facts.trace.vertices_at(step.moment), facts.scene.mesh
    lines = []
    for found in certainties(facts.session, np.array(chosen), step.moment):
        center = vertices[found.vertex]
        if found.is_seen:
            lines.append(ellipsoid_lines(found, center, drawn_half_axis(mesh, vertices, found.vertex)))
    return packed(facts.stage.page_from_world(np.concatenate(lines))) if lines else None


def _axes(facts: RunFacts, step: PlayedStep, page_state: PageState) -> dict[int, list[float]]:
    """Lengths of the axes of the certainty ellipsoid of each selected vertex, relative to the shortest."""
    chosen = page_state.selection.vertices
    if not chosen:
        return {}
    found = certainties(facts.session, np.array(chosen), step.moment)
    return {each.vertex: np.nan_to_num(each.lengths, posinf=1e9).tolist() for each in found if each.is_seen}


def _coloring(facts: RunFacts, step: PlayedStep, page_state: PageState) -> dict[str, Any] | None:
    """The surface coloured by a quantity at the end of the step; None if it is not."""
    if page_state.surface not in COLORINGS:
        return None
    coloring = COLORINGS[page_state.surface]
    vertices = facts.trace.vertices_at(step.moment)
    values, terms = coloring.values(facts.session, step.moment), term_meanings(facts.trace)
    mesh = color_mesh(coloring, values, vertices, facts.scene.mesh.faces, terms)
    return {
        "corners": packed(facts.stage.page_from_world(mesh.vertices[mesh.faces.ravel()])),
        "uv": packed(np.round(np.clip(mesh.uv[mesh.faces.ravel()], 0, 1) * 65535).astype(np.uint16)),
        "picture": "data:image/png;base64," + base64.b64encode(mesh.picture).decode(),
        "legend": legend_html(mesh.legend),
    }


def _flows(facts: RunFacts, step: PlayedStep, page_state: PageState) -> dict[int, dict[str, Any]] | None:
    """Arrows of the columns υ and f by face, for the last step of the current vertex; None if the columns are hidden."""
    vertex, columns = page_state.selected, page_state.cells.columns
    if vertex is None or page_state.cells.page != "cells" or not set(columns) & set(ARROW_KINDS):
        return None
    found = {}
    for face in facts.scene.mesh.one_rings[vertex].tolist():
        query = CellQuery(0, step.moment, face, vertex, page_state.cells.dimensions, with_flows=True)
        flows = cell_facts(facts.session, query).flows
        if flows is not None:
            found[face] = _arrows(flows)
    return found


def _arrows(flows: StepFlows) -> dict[str, Any]:
    """Every second arrow in each direction, as in the debugger."""
    optical, model = flows.optical, flows.model
    size = flows.cells.size
    return {
        "moment": flows.moment,
        "size": size,
        "views": flows.cells.views.tolist(),
        "optical": _vectors(
            optical.places, np.where(optical.confidence[..., None] > MIN_CONFIDENCE, optical.vectors, 0)
        ),
        "model": None if model is None else _vectors(model.places, model.vectors),
    }


def _vectors(places: np.ndarray, vectors: np.ndarray) -> dict[str, Any]:
    """Column and row of the arrows (q, 2), and their components (n, q, 2), both in `PLACE_UNIT` cell pixels."""
    column, row = (np.unique(places[:, k], return_inverse=True)[1] for k in (0, 1))
    chosen = (column % 2 == 1) & (row % 2 == 1)
    return {
        "unit": PLACE_UNIT,
        "places": packed(np.round((places[chosen] + 1 / 3) / PLACE_UNIT).astype(np.int32)),
        "vectors": packed(np.round(vectors[:, chosen] / PLACE_UNIT).astype(np.int32)),
    }


def _profile(facts: RunFacts, step: PlayedStep, page_state: PageState) -> dict[str, Any] | None:
    """The energy of the faces around the current vertex while it is moved along x, y or z, with the cells of the moment."""
    vertex = page_state.selected
    if vertex is None:
        return None
    found = energy_profile(facts.session, vertex, step.moment, REACH * _shortest_edge(facts.scene))
    if found is None:
        return None
    return {"vertex": vertex, "offsets": (100 * found.offsets).tolist(), "lines": found.lines.tolist()}
