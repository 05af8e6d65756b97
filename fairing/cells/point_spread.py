"""Common point spread function (PSF): each photo is blurred around each face until all photos of the face are equally sharp.

The PSF of a photo comes from its lens, its pixels and the level's blur. Back-projected onto the face it is an ellipse that
grows with the camera's distance and is elongated in an oblique view. The cells of one face are therefore blurred
differently, and the difference looks like misalignment: it costs accuracy with one eigenspace dimension, and a second
dimension, which would absorb it, costs precision under noise (ledger: common point spread function). This module finds one
PSF on the face for all its photos, as small as possible, and applies the missing blur to each photo.
(Affine-adapted smoothing: Lindeberg and Garding, Image and Vision Computing 1997.)
"""

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import scipy.fft
from numba import njit

from fairing.camera import Camera
from fairing.cells.scale_space import ScaleSpace

LENS_VARIANCE = 0.36 + 1 / 12
"""px^2: variance of the PSF of a photo as taken: a good lens, and the pixel's box."""
MAX_AREA_RATIO = 3.0
"""An oblique view does not force the others to a PSF of more than this many times the area of the sharpest one."""
PATCH_MARGIN = 6.0
"""px around a face that are blurred too: a vertex may move this far before the patches are computed again (next sweep)."""


def missing_blur(
    cameras: Sequence[Camera], pair_view: np.ndarray, pair_start: np.ndarray, corners: np.ndarray, min_sigma: np.ndarray
) -> np.ndarray:
    """The Gaussians that give all photos of a face one PSF on it.

    Args:
        cameras: V cameras.
        pair_view: (P,) int: pairs of face and view, face by face.
        pair_start: (m + 1,) int: the pairs of face f are pair_start[f] : pair_start[f + 1].
        corners: (m, 3, 3) float: corners of the faces, world units.
        min_sigma: (P,) float: least standard deviation of each pair's PSF, px.

    Returns:
        (P, 2, 2) float: covariances, px^2; zero along directions in which a photo is already blurred enough.
    """
    face = np.repeat(np.arange(len(corners)), np.diff(pair_start))
    axes, centers = _plane_axes(corners), corners.mean(axis=1)
    J = np.empty((len(face), 2, 2))  # J_image_wrt_plane: pixels by position in the face's plane
    for v, camera in enumerate(cameras):
        rows = np.flatnonzero(pair_view == v)
        J[rows] = camera.J_image_wrt_point(centers[face[rows]]) @ axes[face[rows]]
    back = np.linalg.inv(J)
    own = np.maximum(LENS_VARIANCE, min_sigma**2)
    ellipses = back @ back.transpose(0, 2, 1) * own[:, None, None]
    common = np.zeros((len(corners), 2, 2))
    _enclose(ellipses, pair_start, common)
    target = J @ common[face] @ J.transpose(0, 2, 1)
    values, vectors = np.linalg.eigh(target)
    missing = np.maximum(values - LENS_VARIANCE, 0.0)
    return (vectors * missing[:, None, :]) @ vectors.transpose(0, 2, 1)


def patch_pixels(longest_edge: np.ndarray, height: np.ndarray) -> np.ndarray:
    """Approximate number of pixels of the patch around each footprint.

    Args:
        longest_edge, height: (P,) float: longest edge of the footprint and the height on it, px.

    Returns:
        (P,) float.
    """
    return (longest_edge + 2 * PATCH_MARGIN) * (height + 2 * PATCH_MARGIN)


def common_psf_patches(
    photos: ScaleSpace,
    cameras: Sequence[Camera],
    pair_view: np.ndarray,
    pair_start: np.ndarray,
    corners: np.ndarray,
    min_sigma: np.ndarray,
    cubic: bool,
    pool: Executor,
    margin: float = PATCH_MARGIN,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The patch of a photo around the face of every pair, blurred by `missing_blur`, exactly, by Fourier transform.

    Args:
        photos: the photos as taken.
        cameras: V cameras.
        pair_view: (P,) int: pairs of face and view, face by face.
        pair_start: (m + 1,) int: the pairs of face f are pair_start[f] : pair_start[f + 1].
        corners: (m, 3, 3) float: corners of the faces, world units.
        min_sigma: (P,) float: least standard deviation of each pair's PSF, px.
        cubic: return cubic B-spline coefficients instead of pixels.
        pool: executes several photos at a time.
        margin: of the patches, px; see `PATCH_MARGIN`.

    Returns:
        pixels: flat float32, grey levels: the patches' planes (channels, height, width), patch after patch.
        base: (P,) int64: where each patch starts in `pixels`.
        frame: (P, 4) int64: left and top pixel of each patch in its photo, width and height, px.
    """
    covariance = missing_blur(cameras, pair_view, pair_start, corners, min_sigma)
    face = np.repeat(np.arange(len(corners)), np.diff(pair_start))
    corners_px, sizes = np.empty((len(face), 3, 2)), np.empty((len(face), 2), dtype=np.int64)
    pairs_of = {int(v): np.flatnonzero(pair_view == v) for v in np.unique(pair_view)}
    for v, rows in pairs_of.items():
        camera = cameras[v]
        corners_px[rows] = camera.project(corners[face[rows]].reshape(-1, 3))[0].reshape(-1, 3, 2)
        sizes[rows] = camera.width, camera.height
    least = 8  # px: width and height of a patch
    low = np.clip(np.floor(corners_px.min(axis=1) - margin).astype(np.int64), 0, sizes - least)
    high = np.clip(np.ceil(corners_px.max(axis=1) + margin).astype(np.int64) + 2, low + least, sizes)
    frame = np.concatenate([low, high - low], axis=1)
    base = np.concatenate([[0], np.cumsum(photos.channels * frame[:, 2] * frame[:, 3])])
    pixels = np.empty(base[-1], dtype=np.float32)
    deviation = np.sqrt(np.linalg.eigvalsh(covariance)[:, 1])
    # The Gaussian reaches 3.5 standard deviations, the spline's filter 3 px: the outer half of the margin and the border.
    border = np.maximum(np.ceil(3.5 * deviation + 3 - margin / 2), 1).astype(np.int64)

    def fill(view: int, photo: np.ndarray) -> None:
        rows = pairs_of[view]
        outer = frame[rows, :1:-1] + 2 * border[rows, None]
        batches = list(_batches(outer, photos.channels))
        reach = int(border[rows].max())
        # Patches are filled up with their surroundings: an edge to zeros would ring.
        more = max(int((shape - outer[chosen]).max()) for shape, chosen in batches)
        across, down = (_mirrored(-reach, size + 2 * reach + more, size) for size in photo.shape[:0:-1])
        for shape, chosen in batches:
            pairs = rows[chosen]
            stack = np.empty((len(pairs), photos.channels, *shape), dtype=np.float32)
            _cut(photo, photos.grey_levels, down, across, frame[pairs, :2] - border[pairs, None] + reach, stack)
            spectra = np.asarray(scipy.fft.rfft2(stack))
            _multiply(spectra, _transfers(shape, covariance[pairs], cubic))
            _keep(np.asarray(scipy.fft.irfft2(spectra, shape)), border[pairs], frame[pairs, 2:], base[pairs], pixels)

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
def _enclose(ellipses, starts, common):
    """For each face a small ellipse around the PSFs (P, 2, 2) of its photos, into `common` (m, 2, 2).

    Its shape is a weighted mean of the PSFs in which those that extend farthest weigh most (multiplicative updates towards
    the ellipse of least area). Its size encloses them all, up to MAX_AREA_RATIO.
    """
    for f in range(len(starts) - 1):
        first, count = starts[f], starts[f + 1] - starts[f]
        if count == 0:
            continue
        share, reach = np.full(count, 1.0 / count), np.empty(count)
        sharpest = np.inf
        for i in range(count):
            s = ellipses[first + i]
            sharpest = min(sharpest, np.sqrt(s[0, 0] * s[1, 1] - s[0, 1] * s[0, 1]))
        a, b, c, largest, determinant = 0.0, 0.0, 0.0, 0.0, 1.0
        for _ in range(30):
            a, b, c = 0.0, 0.0, 0.0
            for i in range(count):
                s = ellipses[first + i]
                a += share[i] * s[0, 0]
                b += share[i] * s[0, 1]
                c += share[i] * s[1, 1]
            determinant = a * c - b * b
            largest, total = 0.0, 0.0
            for i in range(count):
                # The largest eigenvalue of M^-1 S: how far the PSF S extends beyond the ellipse M.
                s = ellipses[first + i]
                half = (c * s[0, 0] - 2 * b * s[0, 1] + a * s[1, 1]) / determinant / 2
                product = (s[0, 0] * s[1, 1] - s[0, 1] * s[0, 1]) / determinant
                reach[i] = half + np.sqrt(max(half * half - product, 0.0))
                largest = max(largest, reach[i])
                share[i] *= reach[i]
                total += share[i]
            share /= total
        scale = min(largest, MAX_AREA_RATIO * sharpest / np.sqrt(determinant))
        common[f, 0, 0], common[f, 1, 1] = scale * a, scale * c
        common[f, 0, 1] = common[f, 1, 0] = scale * b


def _batches(sizes: np.ndarray, channels: int) -> Iterator[tuple[tuple[int, int], np.ndarray]]:
    """Patches that are transformed together: of one size, rounded up to a multiple of 4 px and to a fast length, and of at most
    2^18 pixels, which stay in the processor's cache. (ledger: batches of patches)

    Args:
        sizes: (r, 2) int: height and width of each patch with its border, px.

    Yields:
        The (height, width) of their transforms, and their indices (b,) int.
    """
    rounded = -(-sizes // 4) * 4
    lengths, at = np.unique(rounded, return_inverse=True)
    fast = np.array([scipy.fft.next_fast_len(length, real=True) or length for length in lengths.tolist()])
    shapes, shape_of = np.unique(fast[at.reshape(sizes.shape)], axis=0, return_inverse=True)
    for k, (rows, columns) in enumerate(shapes.tolist()):
        chosen = np.flatnonzero(shape_of.ravel() == k)
        most = max(1, (1 << 18) // (channels * rows * columns))
        for first in range(0, len(chosen), most):
            yield (rows, columns), chosen[first : first + most]


class _Axis(NamedTuple):
    """An axis of a spectrum: its frequencies (n,) float32, radians per px, and the factors (n,) float32 at them."""

    frequencies: np.ndarray
    factors: np.ndarray


@lru_cache(maxsize=2048)
def _axis(length: int, is_half: bool, cubic: bool) -> _Axis:
    """The axis of a transform of a length, or of half of it; factors with `cubic` give the coefficients of cubic B-splines."""
    w = 2 * np.pi * (scipy.fft.rfftfreq(length) if is_half else scipy.fft.fftfreq(length))
    factors = 3 / (2 + np.cos(w)) if cubic else np.ones_like(w)
    return _Axis(w.astype(np.float32), factors.astype(np.float32))


def _transfers(shape: tuple[int, int], covariances: np.ndarray, cubic: bool) -> np.ndarray:
    """(b, h, w) float32: transfer functions of Gaussians (b, 2, 2), for `rfft2`; with `cubic` divided by that of the cubic
    B-spline's samples.

    For a covariance with a mixed term it jumps at the Nyquist frequency of an axis, where wx or wy is both +pi and -pi: one
    of the two signs is taken.
    """
    rows, columns = _axis(shape[0], False, cubic), _axis(shape[1], True, cubic)
    transfers = _exponents(rows.frequencies, columns.frequencies, covariances.astype(np.float32))
    np.exp(transfers, out=transfers)
    transfers *= rows.factors[:, None] * columns.factors
    return transfers


@njit(cache=True, nogil=True, error_model="numpy")
def _exponents(wy, wx, covariances):
    """(b, h, w) float32: of the Gaussians with covariances (b, 2, 2) at frequencies (h,) and (w,)."""
    result = np.empty((len(covariances), len(wy), len(wx)), dtype=np.float32)
    for b in range(len(covariances)):
        xx, xy, yy = (
            np.float32(0.5) * covariances[b, 0, 0],
            covariances[b, 0, 1],
            np.float32(0.5) * covariances[b, 1, 1],
        )
        for i in range(len(wy)):
            for j in range(len(wx)):
                result[b, i, j] = -(xx * wx[j] * wx[j] + xy * wx[j] * wy[i] + yy * wy[i] * wy[i])
    return result


@njit(cache=True, nogil=True, error_model="numpy")
def _multiply(spectra, transfers):
    """Multiply spectra (b, channels, h, w) by transfer functions (b, h, w), in place."""
    for b in range(spectra.shape[0]):
        for c in range(spectra.shape[1]):
            for i in range(spectra.shape[2]):
                for j in range(spectra.shape[3]):
                    spectra[b, c, i, j] *= transfers[b, i, j]


@njit(cache=True, nogil=True)
def _cut(photo, grey_levels, down, across, corners, stack):
    """Copy a patch of a photo (channels, height, width) from each left top corner (b, 2) into `stack` (b, channels, h, w).

    Rows and columns are indices into `down` and `across`, which hold those of the photo.
    """
    width = stack.shape[3]
    for b in range(stack.shape[0]):
        left, top = corners[b]
        first = across[left]
        is_inside = across[left + width - 1] - first == width - 1
        for c in range(stack.shape[1]):
            for i in range(stack.shape[2]):
                row = down[top + i]
                if is_inside:
                    for j in range(width):
                        stack[b, c, i, j] = np.float32(photo[c, row, first + j]) * grey_levels
                else:
                    for j in range(width):
                        stack[b, c, i, j] = np.float32(photo[c, row, across[left + j]]) * grey_levels


@njit(cache=True, nogil=True)
def _keep(stack, borders, sizes, starts, pixels):
    """Copy patches (b, channels, h, w) without their borders (b,) into `pixels` from `starts` on; sizes (b, 2): width, height."""
    for b in range(stack.shape[0]):
        at, edge, width = starts[b], borders[b], sizes[b, 0]
        for c in range(stack.shape[1]):
            for i in range(edge, edge + sizes[b, 1]):
                for j in range(width):
                    pixels[at + j] = stack[b, c, i, edge + j]
                at += width


def _mirrored(first: int, count: int, size: int) -> np.ndarray:
    """(count,) int: indices from `first` on; those outside 0 to size - 1 are mirrored at the border, then clamped."""
    at = np.abs(np.arange(first, first + count))
    return np.clip(np.where(at >= size, 2 * size - 2 - at, at), 0, size - 1)
