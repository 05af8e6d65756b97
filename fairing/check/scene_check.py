"""Capture check: cameras, coverage, face sizes, texture and exposure, judged before a run by the run's own rules."""

import os
from collections.abc import Iterable
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from fairing.cameras.refinement import Refinement
from fairing.cells.context import CellContext, build_context
from fairing.cells.scale_space import ScaleSpace
from fairing.cells.visibility import Visibility, mesh_orientation
from fairing.check.appearance import Appearance, exposures, measure_appearance
from fairing.check.conventions import explain_reprojection, median_shift
from fairing.check.hints import find_hints, find_suggestions
from fairing.check.memory import memory_needed
from fairing.check.result import SEEN, CamerasCheck, FaceChecks, SceneCheck, ViewCheck
from fairing.geometry.rasterize import rasterize
from fairing.options import FairingOptions
from fairing.placement.judge import judge_placement
from fairing.scene import Scene

PARALLAX_FACES = 10_000  # the parallax is the median over at most this many faces, an even subset
COVERAGE_WIDTH = 500  # px: width of the image in which the covered part of a photo is counted


class _MasksOnly(ScaleSpace):
    """Scale space without photos: the check samples no cells."""

    def lay_out(
        self, blur: float, cubic: bool, requested: Iterable[tuple[int, float]], pool: Executor
    ) -> tuple[np.ndarray, dict[tuple[int, float], int]]:
        return np.zeros(0, dtype=np.float32), dict.fromkeys(requested, 0)


def check_scene(scene: Scene, options: FairingOptions | None = None) -> SceneCheck:
    """Check a scene, with the cameras and points that a run would use, at the finest level of the options.

    Raises:
        InputError: a photo cannot be decoded.
    """
    options, refinement = options or FairingOptions(), scene.refinement
    all_faces = np.ones(len(scene.mesh.faces), dtype=bool)
    vertices, level = scene.mesh.vertices, options.n_levels - 1
    as_seen = options.with_levels(point_spread="as_seen")  # reads no photos
    with ThreadPoolExecutor(options.threads or os.cpu_count()) as pool:
        context = build_context(
            scene, _MasksOnly(scene, color=False), as_seen, level, vertices, mesh_orientation(scene, vertices), all_faces, pool
        )  # fmt: skip
    appearance = measure_appearance(scene, context.reasons)
    bright = exposures(appearance.mean)
    views = tuple(_check_view(scene, v, context, bright[v]) for v in range(len(scene.views)))
    part = context.takes_part
    codes, counts = np.unique(context.reasons, return_counts=True)
    faces = _check_faces(context, appearance)
    check = SceneCheck(
        verdict="good",
        n_faces=len(part),
        faces_in_part=int(part.sum()),
        views_per_face=_percentiles(context.n_views),
        footprint=_percentiles(faces.footprint[part]),
        texture=_percentiles(faces.texture[part & np.isfinite(faces.texture)]),
        reasons={Visibility(code).name.lower(): int(count) for code, count in zip(codes, counts, strict=True)},
        parallax=_parallax(scene, context),
        points=None if scene.sparse_points is None else scene.sparse_points.origin,
        placement=judge_placement(scene),
        mistake=explain_reprojection(scene),
        memory=memory_needed(scene, options),
        views=views,
        faces=faces,
        visibility=context.reasons,
        # A distorted photo is a problem of its own, among the hints.
        warnings=tuple(w for w in scene.warnings if refinement is None or w != refinement.lens_note),
        hints=(),
        suggestions=(),
        cameras=None if refinement is None else _check_cameras(scene, refinement),
    )
    if refinement is not None and refinement.taken:
        corrections = refinement.corrections.tolist()
        views = tuple(replace(view, correction=px) for view, px in zip(views, corrections, strict=True))
        check = replace(check, views=views)
    hints = find_hints(check)
    return replace(
        check,
        verdict="unusable"
        if not part.any() or check.placement.verdict == "elsewhere"
        else "doubtful"
        if hints
        else "good",
        hints=tuple(hints),
        suggestions=tuple(find_suggestions(scene, check, options)),
    )


def _check_cameras(scene: Scene, refinement: Refinement) -> CamerasCheck:
    judgement = refinement.judgement
    return CamerasCheck(
        corrected=refinement.taken,
        line=refinement.reason,
        correction=float(np.median(refinement.corrections)) if refinement.taken else 0.0,
        error_before=0.0 if judgement is None else judgement.error_before,
        error_after=0.0 if judgement is None else judgement.error_after,
        misfits=tuple(scene.views[v].name for v in np.flatnonzero(refinement.misfits)),
        lens_note=refinement.lens_note,
    )


def _check_faces(context: CellContext, appearance: Appearance) -> FaceChecks:
    part = context.takes_part
    counts = np.stack([(context.reasons == code).sum(axis=1) for code in Visibility], axis=1)
    counts[:, list(SEEN)] = 0
    names = [code.name.lower() for code in Visibility]
    reasons = [
        "" if takes_part else names[most] if number else "too_few_photos"
        for takes_part, most, number in zip(
            part.tolist(), counts.argmax(axis=1).tolist(), counts.max(axis=1).tolist(), strict=True
        )
    ]
    return FaceChecks(
        context.n_views, part, np.sqrt(context.footprint_area), appearance.texture, appearance.weakest, reasons
    )


def _check_view(scene: Scene, v: int, context: CellContext, exposure: float) -> ViewCheck:
    view = scene.views[v]
    seen = np.isin(context.reasons[:, v], SEEN)
    shrink = min(1.0, COVERAGE_WIDTH / view.camera.width)
    small = view.camera.resized(*(max(1, round(shrink * size)) for size in (view.camera.width, view.camera.height)))
    face_id, _ = rasterize(scene.mesh.vertices, scene.mesh.faces[seen], small)
    _, depth = view.camera.project(scene.mesh.vertices)
    shift = median_shift(scene, v)
    used = np.unique(scene.mesh.faces)
    return ViewCheck(
        name=view.name,
        width=view.camera.width,
        height=view.camera.height,
        focal_length=float(view.camera.K[0, 0]),
        faces=int(seen.sum()),
        mesh_share=float((face_id >= 0).mean()),
        in_front=float((depth[used] > 0).mean()),
        observations=_observations(scene, v),
        reprojection=_reprojection(scene, v),
        shift=None if shift is None else (float(shift[0]), float(shift[1])),
        exposure=float(exposure) if np.isfinite(exposure) else None,
        masked=0.0 if view.mask is None else float(1 - view.mask.load().mean()),
    )


def _observations(scene: Scene, v: int) -> int:
    sparse = scene.sparse_points
    return 0 if sparse is None else int((sparse.observations[:, 1] == v).sum())


def _reprojection(scene: Scene, v: int) -> float | None:
    sparse = scene.sparse_points
    if sparse is None or not (sparse.observations[:, 1] == v).any():
        return None
    mine = sparse.observations[:, 1] == v
    uv, _ = scene.views[v].camera.project(sparse.positions[sparse.observations[mine, 0]])
    return float(np.median(np.linalg.norm(uv - sparse.pixels[mine], axis=1)))


def _parallax(scene: Scene, context: CellContext) -> float | None:
    """Widest angle between two lines of sight to a face, degrees, median over faces."""
    centers = np.array([view.camera.center for view in scene.views])
    widest = []
    part = np.flatnonzero(context.takes_part)
    for face in part[:: -(-len(part) // PARALLAX_FACES) or 1].tolist():
        rays = centers[context.kernel.pair_view[context.pairs_of(face)]] - scene.mesh.vertices[
            scene.mesh.faces[face]
        ].mean(axis=0)
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        widest.append(np.degrees(np.arccos(np.clip((rays @ rays.T).min(), -1, 1))))
    return float(np.median(widest)) if widest else None


def _percentiles(values: np.ndarray) -> tuple[float, ...]:
    return tuple(np.percentile(values, [0, 25, 50, 75, 100]).tolist()) if len(values) else ()
