"""Data of the replay page: a run as JSON, with long arrays packed.

Positions are integer multiples of `GRID` in page units (see `Stage`). `GRID` is a quarter of a millionth of the mesh's
diagonal, less than a thousandth of a pixel. Small moves become small integers, which compress well (ledger: replay grid).
"""

import base64
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np

from app.debugger.stage_text import stage_hint, stage_line, stage_name
from app.debugger.step_text import step_outcome
from app.export.frame import first_eye
from app.export.packing import packed
from app.export.page_cells import cells_of_run, chosen_vertices
from app.export.page_pulls import pulls_of_run
from app.export.run_facts import RunFacts
from app.export.step_kinds import INTRO, KINDS, kind_of, level_text
from app.export.texture_keyframes import TextureKeyframe, texture_keyframes
from app.palette import CAMERA, NOW, SELECTED, START, TRUTH, css, solid
from app.pictures.stage_colors import COLOR_OF_STAGE, stage_ground
from app.plot_line import Line
from fairing.trace import StepReason, StepRecord

KEYFRAMES = 8
TEXELS = 1024
JPEG_QUALITY = 86
GRID = 2.0**-20  # page units


def page_data(facts: RunFacts, at: int, on_progress: Callable[[float], None]) -> dict[str, Any]:
    """All data that the scripts of the page read.

    Args:
        at: the moment at which the page opens.
        on_progress: called with the fraction that is done.
    """
    keyframes = texture_keyframes(
        facts, facts.key_moments(KEYFRAMES), TEXELS, lambda fraction: on_progress(0.5 * fraction)
    )
    cells = cells_of_run(facts, lambda fraction: on_progress(0.5 + 0.4 * fraction))
    pulls = pulls_of_run(facts, lambda fraction: on_progress(0.9 + 0.1 * fraction))
    return {
        "at": at,
        **scene_data(facts),
        **run_data(facts),
        "keyframes": [packed_keyframe(keyframe) for keyframe in keyframes],
        "kinds": [kind._asdict() for kind in KINDS],
        "intro": INTRO,
        "reasons": {int(reason): reason.text for reason in StepReason},
        "cells": cells,
        "residuals": residuals_of_faces(facts, cells["faces"]),
        "pulls": pulls,
        "chosen": _first_vertex(facts, cells),
    }


def scene_data(facts: RunFacts) -> dict[str, Any]:
    """The scene: mesh, true mesh, cameras, viewpoints and colours."""
    stage, scene = facts.stage, facts.scene
    truth = None if scene.truth is None else scene.truth.vertices
    return {
        "diagonal": stage.scale * scene.mesh.diagonal,
        "stage": {
            "eye": first_eye(stage).tolist(),
            "overview": stage.overview().tolist(),
            "up": stage.up.tolist(),
        },
        "grid": GRID,
        "faces": packed(scene.mesh.faces.astype(np.uint32)),
        "edges": packed(scene.mesh.edges.astype(np.uint32)),
        "truth": None if truth is None else packed(_on_grid(facts, truth)),
        "cameras": packed(_frusta(facts)),
        "colors": {
            "start": START, "now": NOW, "selected": SELECTED, "truth": TRUTH, "camera": CAMERA,
        },
        "css": {
            "start": "var(--start)", "now": "var(--now)", "truth": "var(--truth)", "cameras": solid(CAMERA), "wire": "var(--now)",
        },
    }  # fmt: skip


def run_data(facts: RunFacts) -> dict[str, Any]:
    """The record of a run: positions, steps, energies and levels."""
    return {
        "length": facts.length,
        "start": packed(_on_grid(facts, facts.trace.start)),
        "pace": facts.pace.tolist(),
        **_changes(facts),
        "steps": _steps(facts),
        "sweeps": np.unique(facts.energies.sweeps).tolist(),
        "residual": _line(facts.residual_line),
        "energy": [{"moments": m.tolist(), "values": values.tolist()} for m, values in facts.energy_lines],
        "errors": None if facts.errors is None else facts.errors.tolist(),
        "levels": _levels(facts),
        "stages": _stages(facts),
    }


def _line(line: Line) -> dict[str, Any]:
    return {"moments": line.moments.tolist(), "values": np.round(line.values, 5).tolist()}


def residuals_of_faces(facts: RunFacts, faces: list[int]) -> dict[str, Any]:
    """For each face the comparable residual in each photo, grey levels, by known moment; what its bars show."""
    moments = facts.residual_line.moments.tolist()
    by_moment = [facts.residual(moment) for moment in moments]
    return {
        "moments": moments,
        "faces": {
            face: {view: [round(each[view], 4) for each in found] for view in (found[0] if found else {})}
            for face in faces
            for found in [[each.of_face_by_view(face) for each in by_moment]]
        },
    }


def _on_grid(facts: RunFacts, points: np.ndarray) -> np.ndarray:
    """(..., 3) int32: positions (..., 3), world units, as multiples of `GRID` in page units."""
    return np.round(facts.stage.page_from_world(points).astype(np.float64) / GRID).astype(np.int32)


def packed_keyframe(keyframe: TextureKeyframe) -> dict[str, Any]:
    """A texture with its moment and coordinates."""
    _, encoded = cv2.imencode(".jpg", keyframe.image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return {
        "moment": keyframe.moment,
        "uv": packed(np.round(np.clip(keyframe.uv, 0, 1) * 65535).astype(np.uint16)),
        "picture": "data:image/jpeg;base64," + base64.b64encode(encoded.tobytes()).decode(),
    }


def _changes(facts: RunFacts) -> dict[str, Any]:
    """The vertices that every step moved, with their displacements; and the vertices it involved, with reasons."""
    moved, displacements, involved, reasons = [], [np.zeros((0, 3), dtype=np.int32)], [], []
    place = _on_grid(facts, facts.trace.start)
    for record in facts.trace.steps:
        after = _on_grid(facts, record.after)
        has_moved = (after != place[record.vertices]).any(axis=1)
        moved.append(record.vertices[has_moved])
        displacements.append((after - place[record.vertices])[has_moved])
        place[record.vertices] = after
        involved.append(record.vertices)
        reasons.append(record.reasons)
    return {
        "moved": {
            "starts": packed(_starts(moved)),
            "vertices": packed(_joined(moved).astype(np.uint32)),
            "displacements": packed(np.concatenate(displacements)),
        },
        "involved": {
            "starts": packed(_starts(involved)),
            "vertices": packed(_joined(involved).astype(np.uint32)),
            "reasons": packed(_joined(reasons).astype(np.uint8)),
        },
    }


def _starts(parts: list[np.ndarray]) -> np.ndarray:
    return np.cumsum([0, *map(len, parts)]).astype(np.uint32)


def _joined(parts: list[np.ndarray]) -> np.ndarray:
    return np.concatenate([np.zeros(0, dtype=np.int64), *parts])


def _steps(facts: RunFacts) -> list[dict[str, Any]]:
    return [
        {
            "level": record.position.level + 1,
            "where": stage_line(record, facts.energies.stage_progress(step, facts.length), facts.options),
            "kind": kind_of(record),
            **_measured(facts, step, record),
            "longest": float(record.step_px.max(initial=0)),
            "outcome": step_outcome(record),
        }
        for step, record in enumerate(facts.trace.steps)
    ]


def _measured(facts: RunFacts, step: int, record: StepRecord) -> dict[str, Any]:
    """What a step changed: the energy of the mesh, or of a fit its objective; None where it measured neither."""
    before, after = (float(curve[step]) for curve in (facts.energies.before, facts.energies.after))
    if record.stage.is_fit and not np.isfinite(after):
        return {"measure": "objective", "before": record.objective_before, "after": record.objective_after}
    is_known = facts.energies.is_measured and np.isfinite([before, after]).all()
    return {"measure": "energy", "before": before if is_known else None, "after": after if is_known else None}


def _stages(facts: RunFacts) -> list[dict[str, Any]]:
    return [
        {
            "name": stage_name(stage.kind, stage.level, facts.options),
            "hint": stage_hint(stage, facts.options),
            "first": stage.begin,
            "end": stage.end,
            "color": css(COLOR_OF_STAGE[stage.kind]),
            "ground": stage_ground(stage.kind),
            "is_fit": stage.kind.is_fit,
        }
        for stage in facts.energies.stages(facts.length)
    ]


def _levels(facts: RunFacts) -> list[dict[str, Any]]:
    levels = facts.energies.levels
    result = []
    for level, blur in enumerate(facts.options.by_level("blur")):
        steps = np.flatnonzero(levels == level)
        first, end = (int(steps[0]), int(steps[-1]) + 1) if len(steps) else (0, 0)
        text = level_text(facts.options, level)
        result.append({"number": level + 1, "blur": blur, "first": first, "end": end, "text": text})
    return result


def _first_vertex(facts: RunFacts, cells: dict[str, Any]) -> int:
    """The vertex selected at first: among those with cells in the file, the one around which the run changed most."""
    rings, faces = facts.scene.mesh.one_rings, cells["faces"]
    order = [v for v in chosen_vertices(facts).tolist() if set(faces) & set(rings[v].tolist())]
    before, after = (facts.residual(moment).loss_by_face() for moment in (0, facts.length))
    change = np.zeros(len(before))
    change[faces] = np.abs(after - before)[faces]
    return max(order, key=lambda v: float(change[rings[v]].sum())) if order else int(chosen_vertices(facts)[0])


def _frusta(facts: RunFacts) -> np.ndarray:
    """(lines, 2, 3) float32, page units: line segments of the camera frusta."""
    lines = []
    for view in facts.scene.views:
        camera, depth = view.camera, facts.stage.camera_scale
        w, h = camera.width, camera.height
        rays = np.linalg.solve(camera.K, np.array([[0, w, w, 0], [0, 0, h, h], [1, 1, 1, 1]], dtype=float)).T
        corners = rays @ camera.camera_from_world[:, :3] * depth + facts.stage.page_from_world(camera.center)
        eye = facts.stage.page_from_world(camera.center)
        lines += [(eye, corner) for corner in corners]
        lines += [(corners[k], corners[(k + 1) % 4]) for k in range(4)]
    return np.array(lines, dtype=np.float32)
