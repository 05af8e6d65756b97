"""One point spread for all cells of a face: each photo is blurred by what it lacks of it, around each face.

A photo shows a point of the surface as a small spot: its lens, its pixels and the level's blur. On the face the spot is an
ellipse, larger the farther away the camera and longer the more askance it looks. So the cells of one face are blurred
differently, and what differs looks like misalignment: on the cube an eigenspace of one dimension ends 0.0076 % of the edge
off, and a second dimension, which takes it up, costs precision where there is noise (3.6 times the Cramer-Rao bound). With
one spot on the face for all photos, blurred as little as that allows, k = 1 ends 0.0008 % off, with noise 1.6 times the
bound. (Affine-adapted smoothing: Lindeberg and Garding, Image and Vision Computing 1997.)

Tried and lost: the same at blur 1.2 (fountain from structure from motion: sparse points 0.0872 % from the surface instead
of 0.0801: faces are not quite planes, and more blur lets them off).
"""

from concurrent.futures import Executor

import numpy as np
import scipy.fft
from numba import njit

from fairing.camera import Camera
from fairing.cells.scale_space import ScaleSpace

LENS_VARIANCE = 0.36 + 1 / 12
"""px^2: the spot of a photo as taken: a good lens, and the pixel's box."""
WIDEST = 3.0
"""A photo that looks askance does not make the others blur to more than so many times the area of the sharpest spot."""
TRAVEL = 6.0
"""px around a face that are blurred, too: so far it may move before a sweep ends and this is done anew."""
MOST_PIXELS = 500_000_000
"""Of the parts around all faces together, 2 GB. With more the photos are read as they are: of 100,000 vertices and 200
photos of 20 Mpx the parts would take 35 GB where the photos take 16, and 1.4 million parts minutes a sweep."""
_SHAPE_ROUNDS = 30
_TAIL = 3.5
_SMALLEST = 8


def missing_blur(
    cameras: list[Camera], pair_view: np.ndarray, pair_start: np.ndarray, corners: np.ndarray, least: np.ndarray
) -> np.ndarray:
    """The Gaussians that give all photos of a face one point spread on it.

    Args:
        pair_view: (P,) int: pairs of face and view, face by face.
        pair_start: (m + 1,) int: the pairs of face f are pair_start[f] : pair_start[f + 1].
        corners: (m, 3, 3) float: the faces, world units.
        least: (P,) float: standard deviation of each pair's spot at least, px.

    Returns:
        (P, 2, 2) float: covariances, px^2; zero along directions in which a photo is blurred enough as it is.
    """
    face = np.repeat(np.arange(len(corners)), np.diff(pair_start))
    axes, centers = _plane_axes(corners), corners.mean(axis=1)
    J = np.empty((len(face), 2, 2))  # pixels by place in the face's plane
    for v, camera in enumerate(cameras):
        rows = np.flatnonzero(pair_view == v)
        J[rows] = camera.J_image_wrt_point(centers[face[rows]]) @ axes[face[rows]]
    back = np.linalg.inv(J)
    own = np.maximum(LENS_VARIANCE, least**2)
    spots = back @ back.transpose(0, 2, 1) * own[:, None, None]
    common = np.zeros((len(corners), 2, 2))
    _enclose(spots, pair_start, common)
    wanted = J @ common[face] @ J.transpose(0, 2, 1)
    values, vectors = np.linalg.eigh(wanted)
    missing = np.maximum(values - LENS_VARIANCE, 0.0)
    return (vectors * missing[:, None, :]) @ vectors.transpose(0, 2, 1)


def pixels_around(longest_edge: np.ndarray, height: np.ndarray) -> np.ndarray:
    """(P,) float, about: pixels of the part around each footprint, of its longest edge and its height on it (P,), px."""
    return (longest_edge + 2 * TRAVEL) * (height + 2 * TRAVEL)


def equally_sharp(
    photos: ScaleSpace,
    cameras: list[Camera],
    pair_view: np.ndarray,
    pair_start: np.ndarray,
    corners: np.ndarray,
    least: np.ndarray,
    cubic: bool,
    pool: Executor,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The part of a photo around a face for every pair, blurred by what `missing_blur` says, exactly, by Fourier transform.

    Args:
        cubic: give cubic B-spline coefficients instead of pixels.
        pool: works on several photos at a time.

    Returns:
        `pixels`, `pair_base` and `pair_frame` of `fairing.kernels.data.KernelData`.
    """
    covariance = missing_blur(cameras, pair_view, pair_start, corners, least)
    face = np.repeat(np.arange(len(corners)), np.diff(pair_start))
    corners_px, sizes = np.empty((len(face), 3, 2)), np.empty((len(face), 2), dtype=np.int64)
    pairs_of = {int(v): np.flatnonzero(pair_view == v) for v in np.unique(pair_view)}
    for v, rows in pairs_of.items():
        camera = cameras[v]
        corners_px[rows] = camera.project(corners[face[rows]].reshape(-1, 3))[0].reshape(-1, 3, 2)
        sizes[rows] = camera.width, camera.height
    low = np.clip(np.floor(corners_px.min(axis=1) - TRAVEL).astype(np.int64), 0, sizes - _SMALLEST)
    high = np.clip(np.ceil(corners_px.max(axis=1) + TRAVEL).astype(np.int64) + 2, low + _SMALLEST, sizes)
    frame = np.concatenate([low, high - low], axis=1)
    base = np.concatenate([[0], np.cumsum(photos.channels * frame[:, 2] * frame[:, 3])])
    pixels = np.empty(base[-1], dtype=np.float32)
    deviation = np.sqrt(np.trace(covariance, axis1=1, axis2=2))
    border = np.ceil(_TAIL * deviation).astype(np.int64) + 3

    def fill(view: int, photo: np.ndarray) -> None:
        for pair in pairs_of[view]:
            x, y, width, height = frame[pair]
            edge = border[pair]
            rows = _mirrored(y - edge, height + 2 * edge, photo.shape[1])
            columns = _mirrored(x - edge, width + 2 * edge, photo.shape[2])
            wide = photo[:, rows[:, None], columns].astype(np.float32) * photos.grey_levels
            shape = tuple(scipy.fft.next_fast_len(size, real=True) or size for size in wide.shape[1:])
            spectrum = np.asarray(scipy.fft.rfft2(wide, shape))
            spectrum *= _transfer(shape, covariance[pair], cubic)
            blurred = np.asarray(scipy.fft.irfft2(spectrum, shape))
            pixels[base[pair] : base[pair + 1]] = blurred[:, edge : edge + height, edge : edge + width].ravel()

    photos.for_each(pairs_of, fill, pool)
    return pixels, base[:-1], frame


def _plane_axes(corners: np.ndarray) -> np.ndarray:
    """(m, 3, 2) float: orthonormal axes of the planes of faces (m, 3, 3)."""
    along = corners[:, 1] - corners[:, 0]
    along = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
    across = corners[:, 2] - corners[:, 0]
    across = across - (across * along).sum(axis=1, keepdims=True) * along
    across = across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-300)
    return np.stack([along, across], axis=2)


@njit(cache=True, nogil=True)
def _enclose(spots, starts, common):
    """For each face a small ellipse around the spots (P, 2, 2) of its photos, into `common` (m, 2, 2).

    Its shape is a mean of the spots in which those that reach out farthest weigh most (multiplicative updates towards
    the ellipse of least area), its size what encloses them all, or WIDEST.
    """
    for f in range(len(starts) - 1):
        first, count = starts[f], starts[f + 1] - starts[f]
        if count == 0:
            continue
        share, reach = np.full(count, 1.0 / count), np.empty(count)
        sharpest = np.inf
        for i in range(count):
            s = spots[first + i]
            sharpest = min(sharpest, np.sqrt(s[0, 0] * s[1, 1] - s[0, 1] * s[0, 1]))
        a, b, c, largest, determinant = 0.0, 0.0, 0.0, 0.0, 1.0
        for _ in range(_SHAPE_ROUNDS):
            a, b, c = 0.0, 0.0, 0.0
            for i in range(count):
                s = spots[first + i]
                a += share[i] * s[0, 0]
                b += share[i] * s[0, 1]
                c += share[i] * s[1, 1]
            determinant = a * c - b * b
            largest, total = 0.0, 0.0
            for i in range(count):
                # The largest eigenvalue of M^-1 S: how far the spot reaches out of the ellipse M.
                s = spots[first + i]
                half = (c * s[0, 0] - 2 * b * s[0, 1] + a * s[1, 1]) / determinant / 2
                product = (s[0, 0] * s[1, 1] - s[0, 1] * s[0, 1]) / determinant
                reach[i] = half + np.sqrt(max(half * half - product, 0.0))
                largest = max(largest, reach[i])
                share[i] *= reach[i]
                total += share[i]
            share /= total
        scale = min(largest, WIDEST * sharpest / np.sqrt(determinant))
        common[f, 0, 0], common[f, 1, 1] = scale * a, scale * c
        common[f, 0, 1] = common[f, 1, 0] = scale * b


def _transfer(shape: tuple[int, ...], covariance: np.ndarray, cubic: bool) -> np.ndarray:
    """Fourier transform of the Gaussian, divided by that of the cubic B-spline's samples if coefficients are wanted."""
    wy, wx = 2 * np.pi * scipy.fft.fftfreq(shape[0])[:, None], 2 * np.pi * scipy.fft.rfftfreq(shape[1])[None]
    transfer = np.exp(-0.5 * (covariance[0, 0] * wx * wx + 2 * covariance[0, 1] * wx * wy + covariance[1, 1] * wy * wy))
    if cubic:
        transfer /= (2 + np.cos(wy)) / 3 * (2 + np.cos(wx)) / 3
    return transfer.astype(np.float32)


def _mirrored(first: int, count: int, size: int) -> np.ndarray:
    """(count,) int: places from `first` on, those outside of 0 to size - 1 mirrored at the border, or at it if far away."""
    at = np.abs(np.arange(first, first + count))
    return np.clip(np.where(at >= size, 2 * size - 2 - at, at), 0, size - 1)
