"""The textured model: each face's texture is the first, view-independent component of its eigenspace.

A face's texels as the photos see them are explained by one image U times a gain c for each photo (an eigenspace of one
dimension, fitted robustly: what a reflection, a passer-by or a wrong surface shows loses its weight). The gains of all
faces together tell each photo's exposure, which is taken off, so that neighbours textured from different photos meet
without a seam.
"""

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numba
import numpy as np

from fairing.geometry.rasterize import rasterize
from fairing.scene import Scene, View
from fairing.texture.layout import AtlasLayout
from fairing.texture.texels import columns, place, rows

VIEWS_PER_FACE = 8
SMALLEST_SINE = np.sin(np.radians(12.0))  # of the angle between line of sight and face
LEAST_SCORE = 0.2  # of the best photo's: photos that resolve a face much less blur it more than they help
HIDDEN_DEPTH = 4.0  # pixels' worth of depth by which something in front hides a texel
OUTLIER = 20.0  # grey levels, sigma of the Geman-McClure weight
ROUNDS = 4
SAMPLE_BUDGET = 400_000_000  # bytes of samples held at a time
UNSEEN = 96.0  # grey level of faces that no photo sees
LARGEST_GAIN = 4.0


@dataclass(frozen=True, eq=False)
class TexturedModel:
    """A mesh with one image.

    Attributes:
        vertices: (n, 3) float, world units.
        faces: (m, 3) int.
        uv: (m, 3, 2) float: texture coordinates of the corners, 0 to 1, origin at the top left.
        image: (h, w, 3) uint8, RGB.
    """

    vertices: np.ndarray
    faces: np.ndarray
    uv: np.ndarray
    image: np.ndarray


def textured_model(
    scene: Scene,
    vertices: np.ndarray,
    largest: int = 4096,
    on_progress: Callable[[float], None] = lambda fraction: None,
) -> TexturedModel:
    """Paint the scene's mesh, with its vertices at (n, 3), from the scene's photos.

    Args:
        largest: texels of the texture's width and height at most; within it a texel is about a photo pixel.
        on_progress: told the fraction that is done.

    Raises:
        ValueError: too many faces for the largest texture.
        InputError: a photo cannot be read.
    """
    scores, edges = survey(scene, vertices, lambda fraction: on_progress(0.3 * fraction))
    layout = AtlasLayout.plan(edges, largest)
    chosen = chosen_views(scores)
    image = np.full((layout.height, layout.width, 3), UNSEEN, dtype=np.float32)
    log_gain = np.zeros(chosen.shape)
    texels = most_texels(layout)
    groups = np.cumsum(texels) // max(1, SAMPLE_BUDGET // (VIEWS_PER_FACE * 4))
    n_groups = int(groups[-1]) + 1
    for group in range(n_groups):
        members = np.flatnonzero(groups == group)
        starts, colors, weights = sample(
            scene, vertices, layout, chosen, scores, members,
            lambda fraction, group=group: on_progress(0.3 + 0.65 * (group + fraction) / n_groups),
        )  # fmt: skip
        fuse(
            members, starts, colors, weights, layout.corner, layout.legs, layout.is_turned, layout.gutter, image, log_gain
        )  # fmt: skip
    gain = exposures(layout, chosen, log_gain, len(scene.views))[0]
    _multiply(layout.corner, layout.legs, layout.is_turned, layout.gutter, gain.astype(np.float32), image)
    on_progress(1.0)
    return TexturedModel(vertices, scene.mesh.faces, layout.uv, np.clip(image + 0.5, 0, 255).astype(np.uint8))


def survey(scene: Scene, vertices: np.ndarray, on_progress: Callable[[float], None]) -> tuple[np.ndarray, np.ndarray]:
    """How well each view sees each face (m, V), pixels that show it times the sine of the angle; and the faces' edges
    (m, 3) in pixels of the photos that see them best."""
    faces = scene.mesh.faces
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    scores = np.zeros((len(faces), len(scene.views)), dtype=np.float32)
    edges = np.zeros((len(faces), 3))
    best = np.zeros(len(faces))
    for v, view in enumerate(scene.views):
        face_id, _ = rasterize(vertices, faces, view.camera)
        if view.mask is not None:
            face_id[~view.mask.load()] = -1
        pixels = np.bincount(face_id[face_id >= 0], minlength=len(faces))
        sight = view.camera.center - corners.mean(axis=1)
        sine = np.abs((normals * sight).sum(axis=1)) / np.maximum(np.linalg.norm(sight, axis=1), 1e-300)
        scores[:, v] = np.where(sine > SMALLEST_SINE, pixels * sine * view.weight, 0)
        is_better = scores[:, v] > best
        best = np.maximum(best, scores[:, v])
        uv, _ = view.camera.project(vertices)
        around = uv[faces[is_better]]
        edges[is_better] = np.linalg.norm(np.roll(around, -1, axis=1) - around, axis=2)
        on_progress((v + 1) / len(scene.views))
    return scores, edges


def chosen_views(scores: np.ndarray) -> np.ndarray:
    """(m, VIEWS_PER_FACE) int: the views that paint each face, the best first, -1 for none."""
    order = np.argsort(-scores, axis=1, kind="stable")[:, :VIEWS_PER_FACE]
    found = np.take_along_axis(scores, order, axis=1)
    chosen = np.full((len(scores), VIEWS_PER_FACE), -1)
    chosen[:, : order.shape[1]] = np.where((found > 0) & (found >= LEAST_SCORE * found[:, :1]), order, -1)
    return chosen


def most_texels(layout: AtlasLayout) -> np.ndarray:
    """(m,) int: texels that a face owns at most."""
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
    """The texels of some faces (f,) as their chosen photos show them.

    Returns:
        starts (f + 1,) int: where each face's texels begin; colors (t, VIEWS_PER_FACE, 3) uint8; weights
        (t, VIEWS_PER_FACE) uint8: 0 without a photo, 1 where the photo does not see the texel, more where it does.
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
    """Look up the texels of faces in one photo, into their slots of `colors` and `weights`."""
    camera, photo = view.camera, view.photo.load()
    counts = np.ones(photo.shape[:2], dtype=np.uint8) if view.mask is None else view.mask.load().astype(np.uint8)
    if layout.scale < 1:  # texels are larger than pixels: the mean of those that one covers
        size = max(2, round(camera.width * layout.scale)), max(2, round(camera.height * layout.scale))
        camera = camera.resized(*size)
        photo = cv2.resize(photo, size, interpolation=cv2.INTER_AREA)
        counts = cv2.resize(counts, size, interpolation=cv2.INTER_NEAREST)
    face_id, depth = rasterize(vertices, faces, camera)
    P = camera.image_from_world
    placed = np.take_along_axis(faces[members], layout.order[members], axis=1)
    corners = (vertices @ P[:, :3].T + P[:, 3])[placed]
    # A photo that resolves the face as well as the best counts in full.
    strength = np.clip(255 * np.sqrt(scores / max(float(scores.max()), 1e-9)), 2, 255).astype(np.uint8)
    _look_up(
        slots, starts, corners, strength, layout.legs[members], layout.is_turned[members], layout.gutter,
        photo, counts, members, face_id, depth, HIDDEN_DEPTH / camera.K[0, 0], colors, weights,
    )  # fmt: skip


def exposures(
    layout: AtlasLayout, chosen: np.ndarray, log_gain: np.ndarray, n_views: int
) -> tuple[np.ndarray, np.ndarray]:
    """The gain exp(a) of each face (m,) without the photos' exposures, and these, exp(g), (V,).

    log c_fv = a_f + g_v in least squares, median g 0.
    """
    face, slot = np.nonzero(chosen >= 0)
    view, value = chosen[face, slot], log_gain[face, slot]
    count = np.maximum(np.bincount(face, minlength=len(chosen)), 1)
    # With a_f eliminated each face says: its gains less their mean are its views' exposures less their mean.
    shares = np.zeros((len(chosen), n_views), dtype=np.float32)
    shares[face, view] = 1
    weight = layout.legs.prod(axis=1) / count
    normal = np.diag(np.bincount(view, weight[face] * count[face], n_views)) - shares.T @ (shares * weight[:, None])
    mean = np.bincount(face, value, len(chosen)) / count
    right = np.bincount(view, weight[face] * count[face] * (value - mean[face]), n_views)
    exposure = np.linalg.lstsq(normal, right, rcond=1e-9)[0]
    exposure -= np.median(exposure)  # one odd photo does not shift the rest
    return np.exp(np.bincount(face, value - exposure[view], len(chosen)) / count), np.exp(exposure)


@numba.njit(cache=True, nogil=True)
def _look_up(
    slots, starts, corners, strength, legs, is_turned, gutter,
    photo, counts, members, face_id, depth, tolerance, colors, weights,
):  # fmt: skip
    """Colours of texels; a texel the photo does not see weighs 1 of 255, so that one nobody sees shows something near."""
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


@numba.njit(cache=True, nogil=True)
def fuse(members, starts, colors, weights, corner, legs, is_turned, gutter, image, log_gain):
    """Fit U and c of every face robustly (alternating weighted least squares from the median); U goes to the image."""
    n_slots = weights.shape[1]
    values = np.empty(n_slots)
    for m in range(members.shape[0]):
        face, start = members[m], starts[m]
        n = starts[m + 1] - start
        U = np.full((n, 3), -1.0)  # negative: nothing known yet
        for t in range(n):
            for k in range(3):
                count = 0
                for s in range(n_slots):
                    if weights[start + t, s] > 1:
                        at = count
                        while at > 0 and values[at - 1] > colors[start + t, s, k]:
                            values[at] = values[at - 1]
                            at -= 1
                        values[at] = colors[start + t, s, k]
                        count += 1
                if count > 0:
                    U[t, k] = 0.5 * (values[(count - 1) // 2] + values[count // 2])
        gain = np.ones(n_slots)
        for _ in range(ROUNDS):
            above, below = np.zeros(n_slots), np.zeros(n_slots)
            for t in range(n):
                for s in range(n_slots):
                    if weights[start + t, s] > 1:
                        trust = weights[start + t, s] * _trust(colors[start + t, s], U[t], gain[s])
                        for k in range(3):
                            above[s] += trust * U[t, k] * colors[start + t, s, k]
                            below[s] += trust * U[t, k] * U[t, k]
            for s in range(n_slots):
                if below[s] > 0:
                    gain[s] = min(max(above[s] / below[s], 1 / LARGEST_GAIN), LARGEST_GAIN)
            for t in range(n):
                r, g, b, total = 0.0, 0.0, 0.0, 0.0
                known = False
                for s in range(n_slots):
                    known = known or weights[start + t, s] > 1
                for s in range(n_slots):
                    weight = weights[start + t, s]
                    if weight > 1 or (weight == 1 and not known):
                        trust = weight * gain[s] * (_trust(colors[start + t, s], U[t], gain[s]) if known else 1.0)
                        r += trust * colors[start + t, s, 0]
                        g += trust * colors[start + t, s, 1]
                        b += trust * colors[start + t, s, 2]
                        total += trust * gain[s]
                if total > 0:
                    U[t, 0], U[t, 1], U[t, 2] = r / total, g / total, b / total
        for s in range(n_slots):
            log_gain[face, s] = np.log(gain[s])
        w, h = legs[face, 0], legs[face, 1]
        t = 0
        for row in range(rows(h, gutter)):
            for column in range(columns(row, w, h, gutter)):
                y, x = place(row, column, corner[face], w, h, is_turned[face], gutter)
                if U[t, 0] >= 0:
                    image[y, x] = U[t].astype(np.float32)
                t += 1


@numba.njit(cache=True, nogil=True, inline="always")
def _trust(color, U, gain):
    squared = 0.0
    for k in range(3):
        squared += (color[k] - gain * U[k]) ** 2 / 3
    return 1 / (1 + squared / OUTLIER**2) ** 2


@numba.njit(cache=True, nogil=True)
def _multiply(corner, legs, is_turned, gutter, gain, image):
    for face in range(legs.shape[0]):
        w, h = legs[face, 0], legs[face, 1]
        for row in range(rows(h, gutter)):
            for column in range(columns(row, w, h, gutter)):
                y, x = place(row, column, corner[face], w, h, is_turned[face], gutter)
                for k in range(3):
                    image[y, x, k] *= gain[face]
