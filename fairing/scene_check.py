"""Can this input work? Cameras, coverage and sizes, judged before a run with the run's own rules."""

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from typing import Any, Literal

import cv2
import numpy as np

from fairing.cells import CellContext, build_context, facing
from fairing.mesh_check import inspect_mesh
from fairing.options import FairingOptions
from fairing.scale_space import ScaleSpace
from fairing.scene import Scene
from fairing.visibility import Visibility

# Below these the verdict is "doubtful"; found on captures that worked and on ones made to fail.
MIN_FACES_IN_PART = 0.6
MIN_PARALLAX = 5.0
MAX_REPROJECTION = 1.5
MIN_FOOTPRINT = 8.0
MAX_BRIGHTNESS_RATIO = 1.5


@dataclass(frozen=True)
class ViewCheck:
    """One photo.

    Attributes:
        focal_length: px.
        faces: faces that take part in it.
        mesh_share: part of the photo that the mesh covers, 0 to 1.
        reprojection: median distance of sparse points to where the photo saw them, px; None without any.
        brightness: mean grey level where the mesh is, None where it is nowhere.
    """

    name: str
    width: int
    height: int
    focal_length: float
    faces: int
    mesh_share: float
    reprojection: float | None
    brightness: float | None


@dataclass(frozen=True)
class SceneCheck:
    """What `check_scene` found.

    Attributes:
        faces_in_part: faces seen by enough photos, of `n_faces`.
        views_per_face: percentiles 0, 25, 50, 75, 100 over faces.
        footprint: the same percentiles of the square root of a face's mean area in the photos, px.
        reasons: why faces take no part, as counts over all pairs of face and photo.
        parallax: median over the faces in part of the widest angle between two of their lines of sight, degrees.
        hints: what to do, in order of importance.
    """

    verdict: Literal["good", "doubtful", "unusable"]
    n_faces: int
    faces_in_part: int
    views_per_face: tuple[float, ...]
    footprint: tuple[float, ...]
    reasons: dict[str, int]
    parallax: float | None
    views: tuple[ViewCheck, ...]
    warnings: tuple[str, ...]
    hints: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


def check_scene(scene: Scene, options: FairingOptions | None = None) -> tuple[SceneCheck, np.ndarray]:
    """Judge a scene at the finest level of the options.

    Returns:
        The findings, and the `Visibility` (m, V) of every face in every view.

    Raises:
        InputError: a photo cannot be decoded.
    """
    options = options or FairingOptions()
    photos = ScaleSpace(scene, color=False)
    sound = np.ones(len(scene.mesh.faces), dtype=bool)
    sound[inspect_mesh(scene.mesh).degenerate_faces] = False
    vertices, level = scene.mesh.vertices, options.n_levels - 1
    with ThreadPoolExecutor(options.threads or os.cpu_count()) as pool:
        context = build_context(
            scene, photos, options, level, vertices, facing(scene, vertices), sound, pool
        )  # fmt: skip
    views = tuple(_check_view(scene, v, context) for v in range(len(scene.views)))
    part = context.takes_part
    codes, counts = np.unique(context.reasons, return_counts=True)
    parallax = _parallax(scene, context)
    footprint = _percentiles(np.sqrt(context.footprint_area[part]))
    hints = _hints(context, views, parallax, footprint)
    verdict = "unusable" if not part.any() else "doubtful" if hints else "good"
    check = SceneCheck(
        verdict=verdict,
        n_faces=len(part),
        faces_in_part=int(part.sum()),
        views_per_face=_percentiles(context.n_views),
        footprint=footprint,
        reasons={Visibility(code).name.lower(): int(count) for code, count in zip(codes, counts, strict=True)},
        parallax=parallax,
        views=views,
        warnings=scene.warnings,
        hints=tuple(hints),
    )
    return check, context.reasons


def overlay(scene: Scene, view: int, reasons: np.ndarray) -> np.ndarray:
    """A photo (h, w, 3) uint8 RGB with the mesh drawn over it.

    Green: the face takes part in this photo. Orange: it is turned to the photo but hidden, too small or seen too flat.
    """
    photo = scene.views[view].photo.load().copy()
    uv, _ = scene.views[view].camera.project(scene.mesh.vertices)
    held_back = (Visibility.GRAZING, Visibility.OUTSIDE_PHOTO, Visibility.TOO_SMALL, Visibility.HIDDEN)
    for color, codes in (
        ((255, 150, 40), held_back),
        ((70, 230, 90), (Visibility.SEEN, Visibility.PARTLY_SEEN, Visibility.SURPLUS)),
    ):
        corners = uv[scene.mesh.faces[np.isin(reasons[:, view], codes)]]
        near = np.abs(corners).max(axis=(1, 2)) < 1e5 if len(corners) else np.zeros(0, dtype=bool)
        outlines = np.round(corners[near] * 16).astype(np.int32)
        cv2.polylines(photo, list(outlines), True, color, 1, cv2.LINE_AA, shift=4)
    return photo


def _check_view(scene: Scene, v: int, context: CellContext) -> ViewCheck:
    view = scene.views[v]
    covered = np.zeros((view.camera.height, view.camera.width), dtype=np.uint8)
    uv, _ = view.camera.project(scene.mesh.vertices)
    seen = np.isin(context.reasons[:, v], (Visibility.SEEN, Visibility.PARTLY_SEEN, Visibility.SURPLUS))
    for corners in uv[scene.mesh.faces[seen]]:
        cv2.fillConvexPoly(covered, np.round(corners * 16).astype(np.int32), 1, shift=4)
    grey = cv2.cvtColor(view.photo.load(), cv2.COLOR_RGB2GRAY)
    return ViewCheck(
        name=view.name,
        width=view.camera.width,
        height=view.camera.height,
        focal_length=float(view.camera.K[0, 0]),
        faces=int(seen.sum()),
        mesh_share=float(covered.mean()),
        reprojection=_reprojection(scene, v),
        brightness=float(grey[covered > 0].mean()) if covered.any() else None,
    )


def _reprojection(scene: Scene, v: int) -> float | None:
    sparse = scene.sparse_points
    if sparse is None or not (sparse.observations[:, 1] == v).any():
        return None
    mine = sparse.observations[:, 1] == v
    uv, _ = scene.views[v].camera.project(sparse.positions[sparse.observations[mine, 0]])
    return float(np.median(np.linalg.norm(uv - sparse.pixels[mine], axis=1)))


def _parallax(scene: Scene, context: CellContext) -> float | None:
    """Median over faces of the widest angle between lines of sight, degrees."""
    centers = np.array([view.camera.center for view in scene.views])
    widest = []
    for face in np.flatnonzero(context.takes_part).tolist():
        rays = centers[context.kernel.pair_view[context.pairs_of(face)]] - scene.mesh.vertices[
            scene.mesh.faces[face]
        ].mean(axis=0)
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        widest.append(np.degrees(np.arccos(np.clip((rays @ rays.T).min(), -1, 1))))
    return float(np.median(widest)) if widest else None


def _percentiles(values: np.ndarray) -> tuple[float, ...]:
    return tuple(np.percentile(values, [0, 25, 50, 75, 100]).tolist()) if len(values) else ()


def _hints(
    context: CellContext, views: tuple[ViewCheck, ...], parallax: float | None, footprint: tuple[float, ...]
) -> list[str]:
    hints = []
    part = context.takes_part
    if part.mean() < MIN_FACES_IN_PART:
        # For every face left out: what most of the photos say.
        main = np.bincount(context.reasons[~part].ravel(), minlength=len(Visibility))
        main[[Visibility.SEEN, Visibility.PARTLY_SEEN, Visibility.SURPLUS]] = 0
        reason = Visibility(int(main.argmax()))
        hints.append(
            f"{int((~part).sum())} of {len(part)} faces are seen by fewer than 3 photos, mostly because "
            f"{_REMEDIES[reason]}"
        )
    if part.any() and footprint[2] < MIN_FOOTPRINT:
        hints.append(
            f"faces measure {footprint[2]:.1f} px in the photos (median): too small to hold texture; "
            "use larger photos or a coarser mesh"
        )
    if parallax is not None and parallax < MIN_PARALLAX:
        hints.append(
            f"the photos see a face from within {parallax:.1f} degrees (median), so depth is hardly determined; "
            "add photos from farther aside"
        )
    hints += [
        f"photo {view.name}: sparse points lie {view.reprojection:.1f} px (median) off where it saw them; "
        "its camera does not fit"
        for view in views
        if view.reprojection is not None and view.reprojection > MAX_REPROJECTION
    ]
    blank = [view.name for view in views if view.faces == 0]
    if blank and len(blank) < len(views):
        hints.append(f"{len(blank)} of {len(views)} photos see no face well enough (first: {blank[0]})")
    lights = [view.brightness for view in views if view.brightness]
    if lights and max(lights) > MAX_BRIGHTNESS_RATIO * min(lights):
        hints.append(
            f"brightness differs by a factor of {max(lights) / min(lights):.1f} between photos; "
            "gains do no harm, for haze or offsets try --cells.remove-bias"
        )
    return hints


_REMEDIES = {
    Visibility.BEHIND_CAMERA: "they lie behind the cameras: check the axes of the cameras",
    Visibility.TURNED_AWAY: "they are turned away: add photos from the other side, or turn the faces",
    Visibility.GRAZING: "they are seen too flat: add photos that face them",
    Visibility.OUTSIDE_PHOTO: "they lie outside the photos: check that mesh and cameras share their coordinates",
    Visibility.TOO_SMALL: "they are too small in the photos: use larger photos or a coarser mesh",
    Visibility.HIDDEN: "other faces hide them: add photos, or check the mesh for faces in front",
    Visibility.DEGENERATE: "they have no area: repair the mesh",
}
