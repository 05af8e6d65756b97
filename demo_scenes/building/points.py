"""Sparse points like those of structure from motion: keypoints of textured places, tracked, triangulated with noise."""

from dataclasses import dataclass

import numpy as np

from demo_scenes.building.plan import Plan
from demo_scenes.noise import seeded
from demo_scenes.sheet import Sheet
from fairing.geometry.rasterize import rasterize
from fairing.scene import SparsePoints, View

KEYPOINTS_PER_MEGAPIXEL = 2200  # of each photo
LEAST_TRACK = 3  # photos of a point
DETECTED = (0.15, 0.8)  # share of the photos that see a point in which it is found; drawn for each point
DIFFERENT = 35.0  # grey levels: an observation that looks this different from the track's median is no match
LEAST_CONTRAST = 2.0  # grey levels per pixel
ROUNDS = 6  # Gauss-Newton iterations of the triangulation
WORST_RESIDUAL = 4.0  # pixels, rms: tracks above it are dropped


@dataclass(frozen=True, eq=False)
class SfmPoints:
    """Triangulated points.

    Attributes:
        sparse: as a capture has them.
        on_building: (n,) bool: whether a point belongs to the surface that the mesh stands for.
    """

    sparse: SparsePoints
    on_building: np.ndarray


def sfm_points(plan: Plan, everything: Sheet, building_faces: int, views: tuple[View, ...]) -> SfmPoints:
    """Points on all that the photos show, a part of them on ground and background.

    Each point is triangulated from noisy pixels, so that its error has the covariance that the rays give it.

    Args:
        everything: building and surroundings; the first `building_faces` faces are the building's.
    """
    rng = seeded(*plan.seed, 65)
    maps = [rasterize(everything.vertices, everything.faces, view.camera) for view in views]
    photos = [view.photo.load().astype(np.float64) for view in views]
    places, faces = [], []
    for view, (face_id, depth), photo in zip(views, maps, photos, strict=True):
        row, column = _keypoints(photo.mean(axis=2), face_id, rng)
        places.append(_on_rays(view, row, column, depth[row, column]))
        faces.append(face_id[row, column])
    X, face = np.concatenate(places), np.concatenate(faces)
    chosen = rng.permutation(len(X))[: max(200, len(X) // 4)]  # the same place is a keypoint in several photos
    X, face = X[chosen], face[chosen]

    pixels = np.stack([view.camera.project(X)[0] for view in views], axis=1)
    sees, colors = np.zeros(pixels.shape[:2], bool), np.zeros((*pixels.shape[:2], 3))
    for k, (view, (face_id, _), photo) in enumerate(zip(views, maps, photos, strict=True)):
        sees[:, k], colors[:, k] = _seen_colors(view, pixels[:, k], face, face_id, photo, X)
    sees &= rng.random(sees.shape) < rng.uniform(*DETECTED, (len(X), 1))
    level = np.where(sees, colors.mean(axis=2), np.nan)
    sees &= sees.sum(axis=1, keepdims=True) >= LEAST_TRACK
    kept = np.flatnonzero(sees.any(axis=1))
    sees, X, face = sees[kept], X[kept], face[kept]
    pixels, colors, level = pixels[kept], colors[kept], level[kept]
    sees &= np.abs(level - np.nanmedian(level, axis=1, keepdims=True)) < DIFFERENT
    pixels = pixels + plan.point_px * rng.standard_normal(pixels.shape)
    X, residual = _triangulated(views, X, pixels, sees)
    kept = np.flatnonzero((sees.sum(axis=1) >= LEAST_TRACK) & (residual < WORST_RESIDUAL))
    sees, pixels, colors = sees[kept], pixels[kept], colors[kept]
    point_id, view_id = np.nonzero(sees)
    mean_color = (colors * sees[..., None]).sum(axis=1) / sees.sum(axis=1)[:, None]
    sparse = SparsePoints(
        X[kept],
        np.rint(mean_color).astype(np.uint8),
        np.column_stack([point_id, view_id]),
        pixels[point_id, view_id],
    )
    return SfmPoints(sparse, face[kept] < building_faces)


def _keypoints(grey: np.ndarray, face_id: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Row and column of random pixels, likelier where the photo (h, w) has contrast; none in the sky."""
    down, across = np.gradient(grey)
    strength = np.hypot(down, across)
    strength[(face_id < 0) | (strength < LEAST_CONTRAST)] = 0
    strength[[0, -1]] = strength[:, [0, -1]] = 0
    weights = np.sqrt(strength).ravel()
    count = min(round(KEYPOINTS_PER_MEGAPIXEL * grey.size / 1e6), int((weights > 0).sum()))
    # Evenly spaced along the summed weights, with one random offset each.
    at = (np.arange(count) + rng.random(count)) / max(count, 1) * weights.sum()
    chosen = np.minimum(np.searchsorted(np.cumsum(weights), at, side="right"), grey.size - 1)
    return np.unravel_index(chosen, grey.shape)  # pyright: ignore[reportReturnType]


def _on_rays(view: View, row: np.ndarray, column: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """(p, 3) float: points at a depth on the rays of pixels."""
    P = view.camera.image_from_world
    scaled = np.stack([column, row, np.ones(len(row))]) * depth
    # The depth is the distance along the optical axis; P may carry any scale.
    scale = np.linalg.norm(P[2, :3])
    return np.linalg.solve(P[:, :3], scale * scaled - P[:, 3:]).T


def _seen_colors(
    view: View, uv: np.ndarray, face: np.ndarray, face_id: np.ndarray, photo: np.ndarray, X: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Whether a photo shows the face of each point where the point projects, and its colour there."""
    height, width = face_id.shape
    depth = view.camera.project(X)[1]
    column, row = np.rint(np.nan_to_num(uv, nan=-1)).clip(-1, 1 << 20).astype(int).T
    inside = (depth > 0) & (column >= 0) & (row >= 0) & (column < width) & (row < height)
    column, row = np.where(inside, column, 0), np.where(inside, row, 0)
    return inside & (face_id[row, column] == face), photo[row, column]


def _triangulated(
    views: tuple[View, ...], X: np.ndarray, pixels: np.ndarray, sees: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Points (p, 3) that minimise the reprojection error, from a start near them, and its rms (p,) in pixels."""
    X = X.copy()
    weight = sees[..., None].astype(float)
    residual = np.zeros_like(pixels)
    for _ in range(ROUNDS):
        H, g = np.zeros((len(X), 3, 3)), np.zeros((len(X), 3))
        for k, view in enumerate(views):
            P = view.camera.image_from_world
            h = X @ P[:, :3].T + P[:, 3]
            residual[:, k] = h[:, :2] / h[:, 2:] - pixels[:, k]
            J = (P[None, :2, :3] - (h[:, :2] / h[:, 2:])[..., None] * P[None, 2:, :3]) / h[:, 2:, None]
            J = J * weight[:, k, :, None]
            H += np.einsum("pij,pik->pjk", J, J)
            g += np.einsum("pij,pi->pj", J, residual[:, k])
        H += 1e-9 * np.trace(H, axis1=1, axis2=2)[:, None, None] * np.eye(3) + 1e-12 * np.eye(3)
        X -= np.linalg.solve(H, g[..., None])[..., 0]
    n = np.maximum(sees.sum(axis=1), 1)
    return X, np.sqrt((weight * residual**2).sum(axis=(1, 2)) / n)
