"""The fused kernel's work done with cv2.remap and numpy: the speed to beat, and an oracle for the result.

Homography warp, grey, no masks, Geman-McClure, variable projection, one moving corner a face.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from fairing.kernels.data import KernelData


@dataclass(frozen=True, eq=False)
class TwinPhotos:
    """Blurred photos and their forward differences, by where they start in the kernel's pixels.

    The slope of a bilinear surface interpolates the differences along the other axis.
    """

    photos: dict[int, np.ndarray]
    along_x: dict[int, np.ndarray]
    along_y: dict[int, np.ndarray]

    @classmethod
    def of(cls, data: KernelData) -> "TwinPhotos":
        photos = {}
        for base, (left, top, width, height) in zip(data.pair_base.tolist(), data.pair_frame, strict=True):
            assert left == top == 0, "the twin reads whole photos"
            photos[base] = data.pixels[base : base + width * height].reshape(height, width)
        along_x = {base: np.diff(photo, axis=1, append=photo[:, -1:]) for base, photo in photos.items()}
        along_y = {base: np.diff(photo, axis=0, append=photo[-1:]) for base, photo in photos.items()}
        return cls(photos, along_x, along_y)


def evaluate_face(
    data: KernelData, photos: TwinPhotos, vertices: np.ndarray, face: int, corner: int, scale: float
) -> tuple[float, np.ndarray, np.ndarray]:
    """Energy, normal matrix (3, 3) and gradient (3,) of one face by one of its corners."""
    hats, k = barycentric(data, face), int(data.face_dimensions[face])
    pairs = range(data.pair_start[face], data.pair_start[face + 1])
    n, p = len(pairs), hats.shape[1]
    cells, G = np.empty((n, p), np.float32), np.empty((3, n, p), np.float32)
    for i, pair in enumerate(pairs):
        base, P = int(data.pair_base[pair]), data.image_from_world[data.pair_camera[pair]]
        x, y, inverse = places(data, vertices, face, pair, hats)
        cells[i] = _read(photos.photos[base], x, y)
        u = _read(photos.along_x[base], np.floor(x), y) * inverse
        v = _read(photos.along_y[base], x, np.floor(y)) * inverse
        r = u * x + v * y
        for axis in range(3):
            G[axis, i] = u * np.float32(P[0, axis]) + v * np.float32(P[1, axis]) - r * np.float32(P[2, axis])
    gram = (cells @ cells.T).astype(np.float64)
    values, vectors = np.linalg.eigh(gram)
    V = vectors[:, ::-1][:, :k].astype(np.float32)
    U = (V.T @ cells) / np.sqrt(np.maximum(values[::-1][:k], 1e-12))[:, None].astype(np.float32)
    residual = cells - V @ (V.T @ cells)
    inverse = 1 / (np.float32(scale) + residual * residual)
    weight = data.pair_weight[pairs.start : pairs.stop].astype(np.float32)[:, None]
    energy = float((weight * residual * residual * inverse).sum(dtype=np.float64))
    weight = weight * 2 * np.float32(scale) * inverse * inverse
    J = G - V @ (V.T @ G)  # the sampled derivative, complement of the coefficients
    J *= hats[corner]
    J -= (J @ U.T) @ U  # complement of the basis images
    J = J.reshape(3, -1)
    weighted = J * weight.ravel()
    return energy, (weighted @ J.T).astype(np.float64), (weighted @ residual.ravel()).astype(np.float64)


def barycentric(data: KernelData, face: int) -> np.ndarray:
    """Barycentric coordinates (3, p) of a face's samples."""
    grid = slice(data.grid_start[data.face_grid[face]], data.grid_start[data.face_grid[face] + 1])
    inset = np.float32(data.face_inset[face])
    ramp = inset + (1 - 3 * inset) * data.ramp[:, grid]
    return np.stack([ramp[0], ramp[1], 1 - ramp[0] - ramp[1]])


def places(
    data: KernelData, vertices: np.ndarray, face: int, pair: int, hats: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Photo coordinates x, y (p,) of a face's samples in one of its photos, and their inverse depths (p,), float32."""
    P, corners = data.image_from_world[data.pair_camera[pair]], vertices[data.faces[face]]
    homogeneous = ((P[:, :3] @ corners.T + P[:, 3:]) @ hats).astype(np.float32)
    inverse = 1 / homogeneous[2]
    return homogeneous[0] * inverse, homogeneous[1] * inverse, inverse


def reads(
    data: KernelData, photos: TwinPhotos, vertices: np.ndarray
) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """What the faces read: a photo and the coordinates x, y (1, p) for every pair, the arguments of `cv2.remap`."""
    return [
        (photos.photos[int(data.pair_base[pair])], x[None], y[None])
        for face in range(len(data.faces))
        for pair in range(data.pair_start[face], data.pair_start[face + 1])
        for x, y, _ in [places(data, vertices, face, pair, barycentric(data, face))]
    ]


def _read(image: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return cv2.remap(image, x[None], y[None], cv2.INTER_LINEAR)[0]
