"""Photo agreement: how alike the photos show the faces of a mesh in a frame, to choose between frames without points.

Where the mesh lies on the surface, two photos show the same texture in a face (normalized cross-correlation near 1); elsewhere
they show unrelated parts of the scene (near 0).
"""

from collections.abc import Sequence
from itertools import combinations

import cv2
import numpy as np

from fairing.geometry.rasterize import rasterize
from fairing.mesh import Mesh
from fairing.placement.frames import IDENTITY, MeshFrame
from fairing.scene import View

WIDTH = 400
"""Px: photos are compared at that width, where a rough start is a few pixels off."""
MOST_VIEWS, MOST_FACES = 12, 400
GRID = 12
"""Samples along the side of a face."""
LEAST_SHOWN = 0.5
"""Of a face's samples that two photos have to show."""
LEAST_CONTRAST = 2.0
"""Grey levels: standard deviation of the samples in a photo; blank faces are alike anywhere."""
LEAST_AGREEMENT, LEAST_RATIO = 0.1, 1.5
"""Agreement in a frame that is chosen, and least ratio to that of the mesh as it is."""


def better_frame_by_photos(mesh: Mesh, views: Sequence[View], frames: Sequence[MeshFrame]) -> MeshFrame | None:
    """The frame in which the photos clearly agree better about the mesh than where it is, or None.

    Raises:
        InputError: a photo cannot be decoded.
    """
    chosen = _pairs_of_neighbours(views)
    pictures = [_picture(view) for view in chosen]

    def agreement(frame: MeshFrame) -> float:
        return photo_agreement(mesh, chosen, pictures, frame)

    found = [(agreement(frame), -i) for i, frame in enumerate(frames)]
    if not found:
        return None
    best, i = max(found)
    is_better = best >= max(LEAST_AGREEMENT, LEAST_RATIO * agreement(IDENTITY))
    return frames[-i] if is_better else None


def photo_agreement(mesh: Mesh, views: Sequence[View], pictures: Sequence[np.ndarray], frame: MeshFrame) -> float:
    """Mean over the faces of their correlation in the pairs of photos that show them, -1 to 1; 0 for a face that no pair shows.

    Args:
        pictures: (h, w) float32 grey levels of each view, of `WIDTH` or less.
    """
    faces = mesh.faces[:: max(1, -(-len(mesh.faces) // MOST_FACES))]
    corners = np.einsum("kc,fcx->fkx", _weights(), mesh.vertices[faces])
    samples, shown = [], []
    for view, picture in zip(views, pictures, strict=True):
        camera = frame.camera(view.camera.resized(picture.shape[1], picture.shape[0]))
        _, depth = rasterize(mesh.vertices, mesh.faces, camera)
        uv, own_depth = camera.project(corners)
        with np.errstate(invalid="ignore"):
            at = np.nan_to_num(uv, nan=-1e6, posinf=-1e6, neginf=-1e6).clip(-1e6, 1e6).astype(np.float32)
        x, y = np.round(at[..., 0]).astype(int), np.round(at[..., 1]).astype(int)
        is_inside = (x >= 0) & (y >= 0) & (x < picture.shape[1]) & (y < picture.shape[0]) & (own_depth > 0)
        visible = np.where(is_inside, depth[y.clip(0, len(picture) - 1), x.clip(0, picture.shape[1] - 1)], 0)
        shown.append(is_inside & (own_depth <= 1.02 * visible))
        samples.append(cv2.remap(picture, at[..., 0], at[..., 1], cv2.INTER_LINEAR))
    found: dict[int, list[float]] = {}
    for a, b in combinations(range(len(views)), 2):
        both = shown[a] & shown[b]
        for face in np.flatnonzero(both.mean(axis=1) >= LEAST_SHOWN).tolist():
            one, other = (samples[v][face][both[face]] for v in (a, b))
            if min(one.std(), other.std()) >= LEAST_CONTRAST:
                found.setdefault(face, []).append(float(np.corrcoef(one, other)[0, 1]))
    return sum(float(np.mean(values)) for values in found.values()) / len(faces)


def _pairs_of_neighbours(views: Sequence[View]) -> list[View]:
    """At most `MOST_VIEWS` views, two successive ones at each of several places in their order: these overlap most."""
    if len(views) <= MOST_VIEWS:
        return list(views)
    first = np.linspace(0, len(views) - 2, MOST_VIEWS // 2).astype(int)
    return [views[i] for i in np.unique(np.concatenate([first, first + 1]))]


def _picture(view: View) -> np.ndarray:
    photo = view.photo.load()
    grey = photo.astype(np.float32).mean(axis=2) if photo.ndim == 3 else photo.astype(np.float32)
    width = min(WIDTH, grey.shape[1])
    return cv2.resize(grey, (width, max(1, round(grey.shape[0] * width / grey.shape[1]))), interpolation=cv2.INTER_AREA)


def _weights() -> np.ndarray:
    """(k, 3) float: barycentric coordinates of the samples of a face."""
    i, j = np.meshgrid(np.arange(GRID), np.arange(GRID), indexing="ij")
    inside = i + j < GRID
    a, b = (i[inside] + 1 / 3) / GRID, (j[inside] + 1 / 3) / GRID
    return np.column_stack([a, b, 1 - a - b])
