"""Texture samples: the colours of a face's texels in its chosen photos."""

from collections.abc import Callable

import cv2
import numba
import numpy as np

from fairing.geometry.rasterize import HIDDEN_DEPTH, rasterize
from fairing.scene import Scene, View
from fairing.texture.layout import AtlasLayout
from fairing.texture.texels import SOURCE, columns, rows
from fairing.texture.view_choice import VIEWS_PER_FACE
from fairing.util.compiled_only import COMPILED_ONLY


def most_texels(layout: AtlasLayout) -> np.ndarray:
    """(m,) int: upper bound of the texels that each face owns."""
    return layout.box.prod(axis=1) // 2 + layout.box.sum(axis=1)


def sample(
    scene: Scene,
    vertices: np.ndarray,
    layout: AtlasLayout,
    chosen: np.ndarray,
    scores: np.ndarray,
    members: np.ndarray,
    on_progress: Callable[[float], None] = lambda fraction: None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sample the texels of some faces from their chosen photos.

    Args:
        vertices: (n, 3) float, world units.
        chosen: (m, VIEWS_PER_FACE) int, from `chosen_views`.
        scores: (m, V) float32, from `survey`.
        members: (f,) int: face ids.
        on_progress: callback with the completed fraction, 0 to 1.

    Returns:
        starts: (f + 1,) int: where each face's texels start.
        colors: (t, VIEWS_PER_FACE, 3) uint8, RGB.
        weights: (t, VIEWS_PER_FACE) uint8: 0 without a photo, 1 where the photo does not see the texel, more where it does.
    """
    starts = np.r_[0, np.cumsum(most_texels(layout)[members])]
    colors = np.zeros((starts[-1], VIEWS_PER_FACE, 3), dtype=np.uint8)
    weights = np.zeros((starts[-1], VIEWS_PER_FACE), dtype=np.uint8)
    for v, view in enumerate(scene.views):
        is_slot = chosen[members] == v
        slots = np.where(is_slot.any(axis=1), np.argmax(is_slot, axis=1), -1)
        if (slots >= 0).any():
            _sample_photo(
                layout, view, vertices, scene.mesh.faces, members, starts, slots, scores[members, v], colors, weights
            )
        on_progress((v + 1) / len(scene.views))
    return starts, colors, weights


def _sample_photo(
    layout: AtlasLayout,
    view: View,
    vertices: np.ndarray,
    faces: np.ndarray,
    members: np.ndarray,
    starts: np.ndarray,
    slots: np.ndarray,
    scores: np.ndarray,
    colors: np.ndarray,
    weights: np.ndarray,
) -> None:
    """Sample the texels of faces from one photo, into their slots of `colors` and `weights`."""
    camera, photo = view.camera, view.photo.load()
    counts = np.ones(photo.shape[:2], dtype=np.uint8) if view.mask is None else view.mask.load().astype(np.uint8)
    if layout.scale < 1:  # texels are larger than pixels: average the pixels that a texel covers
        size = max(2, round(camera.width * layout.scale)), max(2, round(camera.height * layout.scale))
        camera = camera.resized(*size)
        photo = cv2.resize(photo, size, interpolation=cv2.INTER_AREA)
        counts = cv2.resize(counts, size, interpolation=cv2.INTER_NEAREST)
    face_id, depth = rasterize(vertices, faces, camera)
    P = camera.image_from_world
    placed = np.take_along_axis(faces[members], layout.order[members], axis=1)
    corners = (vertices @ P[:, :3].T + P[:, 3])[placed]
    # The photo with the best score has full weight.
    strength = np.clip(255 * np.sqrt(scores / max(float(scores.max()), 1e-9)), 2, 255).astype(np.uint8)
    look_up(
        slots, starts, corners, strength, layout.legs[members], layout.is_turned[members], layout.gutter,
        # numba compiles again for what is read-only, as given photos are and reduced ones are not.
        np.require(photo, requirements=["C", "W"]), counts,
        members, face_id, depth, HIDDEN_DEPTH / camera.K[0, 0], colors, weights,
    )  # fmt: skip


@numba.njit(nogil=True, **COMPILED_ONLY)
def _look_up(
    slots, starts, corners, strength, legs, is_turned, gutter,
    photo, counts, members, face_id, depth, tolerance, colors, weights,
):  # fmt: skip
    """Colours of texels; unseen texels get the weight 1 of 255, so that a texel that no photo sees has a plausible colour."""
    height, width = depth.shape
    for m in range(slots.shape[0]):
        slot = slots[m]
        if slot < 0:
            continue
        w, h = legs[m, 0], legs[m, 1]
        t = starts[m]
        for row in range(rows(h, gutter)):
            for column in range(columns(row, w, h, gutter)):
                b, c = (column - gutter) / w, (row - gutter) / h
                a = 1 - b - c
                z = a * corners[m, 0, 2] + b * corners[m, 1, 2] + c * corners[m, 2, 2]
                if z > 0:
                    x = (a * corners[m, 0, 0] + b * corners[m, 1, 0] + c * corners[m, 2, 0]) / z
                    y = (a * corners[m, 0, 1] + b * corners[m, 1, 1] + c * corners[m, 2, 1]) / z
                    inside = 0 <= x <= width - 1 and 0 <= y <= height - 1
                    x, y = min(max(x, 0.0), width - 1.001), min(max(y, 0.0), height - 1.001)
                    nearest_x, nearest_y = int(x + 0.5), int(y + 0.5)
                    seen = inside and counts[nearest_y, nearest_x] > 0 and (
                        face_id[nearest_y, nearest_x] == members[m]
                        or z <= depth[nearest_y, nearest_x] + tolerance * z
                    )  # fmt: skip
                    weights[t, slot] = strength[m] if seen else 1
                    ix, iy = int(x), int(y)
                    fx, fy = x - ix, y - iy
                    for k in range(3):
                        top = photo[iy, ix, k] * (1 - fx) + photo[iy, ix + 1, k] * fx
                        bottom = photo[iy + 1, ix, k] * (1 - fx) + photo[iy + 1, ix + 1, k] * fx
                        colors[t, slot, k] = np.uint8(top * (1 - fy) + bottom * fy + 0.5)
                t += 1


def _cached_for(source):
    @numba.njit(cache=True, nogil=True)
    def look_up(*arguments):
        """See `_look_up`."""
        assert source >= 0
        _look_up(*arguments)

    return look_up


look_up = _cached_for(SOURCE)
