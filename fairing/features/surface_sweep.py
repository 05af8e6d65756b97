"""Surface sweep: points of all textured pixels near a start mesh, by correlating the photos along copies of the mesh.

A plane sweep (Collins, CVPR 1996) whose planes are replaced by the mesh, displaced along the lines of sight of a photo in
steps of inverse depth: neighbouring photos are warped onto each copy and compared with the photo by normalized cross-correlation
in small windows. The best copy of a pixel gives its depth; it counts where that of another photo agrees. Keypoints are sparse and
need distinct texture; these points cover all textured parts, but only within reach of the start. (ledger: surface sweep)
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from typing import NamedTuple, TypeVar

import cv2
import numpy as np
from numba import njit

from fairing.camera import Camera, resizing
from fairing.features.options import FeatureOptions
from fairing.features.pairs import nearest_photos
from fairing.features.points import FeaturePoints
from fairing.geometry.rasterize import rasterize_inverse
from fairing.mesh import Mesh
from fairing.photo import grey_levels
from fairing.scene import View

T = TypeVar("T")
MEGAPIXELS = 0.35
"""Larger photos are reduced to this size ..."""
LARGEST_ERROR = 6.0
"""... and further, until the start error has this many pixels."""
NEIGHBORS = 4
"""Photos each photo is compared with: the nearest ones that look in a similar direction, see `FeatureOptions.axis_angle`."""
HALF_WINDOW = 2
"""px: windows of the correlation have (2 HALF_WINDOW + 1)^2 pixels."""
REACH = 2.0
"""Of the start error: displacements of the mesh along lines of sight; these meet most faces obliquely."""
NOISE = 4.0
"""Grey levels^2: added to the variances of a window, so that those without texture do not correlate."""
POINTS_PER_FACE = 50
"""Of all photos, at most; evenly left out beyond."""
SIGMA = 0.4
"""Standard deviation of a point along its line of sight, in steps, and across it, in px (ledger: surface sweep: sigma)."""


class _Reduced(NamedTuple):
    """A photo of the sweep: camera, grey levels (height, width) float32, and (height, width) bool: pixels that count."""

    camera: Camera
    grey: np.ndarray
    counts: np.ndarray


class _Depths(NamedTuple):
    """Attributes:
    inverse: (height, width) float64, 1 / world units; 0 where unknown.
    step: 1 / world units: between two copies of the mesh.
    face: (height, width) int: of the mesh; -1 beside it.
    """

    inverse: np.ndarray
    step: float
    face: np.ndarray


class SurfaceSweep:
    """Sweeps through the photos of a scene, from several states of a mesh.

    Args:
        executor: runs one task for each photo; the result does not depend on it.
        check: called for every copy of the mesh, from several threads; may raise `Cancelled`.
        on_progress: called with the part of a sweep that is done, 0 to 1.
    """

    def __init__(
        self,
        views: Sequence[View],
        executor: Executor,
        check: Callable[[], None] = lambda: None,
        on_progress: Callable[[float], None] = lambda part: None,
    ) -> None:
        self._views, self._executor, self._check, self._on_progress = views, executor, check, on_progress
        self._neighbors = nearest_photos([view.camera for view in views], NEIGHBORS, FeatureOptions.axis_angle)

    def points(self, mesh: Mesh, error: float) -> FeaturePoints:
        """Points near a mesh whose vertices are about `error` px off.

        Each has one observation, by the photo whose depth it is; pixels, residuals and colours are not given.

        Raises:
            Cancelled: by `check`.
        """
        photos = list(self._followed(self._executor.map(lambda view: _reduced(view, error), self._views), 0.0))

        def depths(number: int) -> _Depths:
            px = self._views[number].camera.width / photos[number].camera.width
            return self._depths(photos, number, mesh, error / px)

        every = range(len(photos))
        found = list(self._followed(self._executor.map(depths, every), 0.5))
        parts = [self._points_of(photos, number, found) for number in every]
        positions, covariance, photo, faces = (np.concatenate(values) for values in zip(*parts, strict=True))
        if len(positions) == 0:
            return FeaturePoints.none("no pixel's depth agrees in enough photos")
        kept = _spread(faces)
        positions, covariance, photo, count = positions[kept], covariance[kept], photo[kept], len(kept)
        return FeaturePoints(
            positions, covariance, np.zeros((count, 3), np.uint8), np.arange(count + 1), photo,
            np.zeros((count, 2)), np.zeros(count), SIGMA,
        )  # fmt: skip

    def _followed(self, of_photos: Iterator[T], begin: float) -> Iterator[T]:
        """The results of half of a sweep, of which each tells the progress."""
        for number, result in enumerate(of_photos):
            self._on_progress(begin + 0.5 * (number + 1) / len(self._views))
            yield result

    def _depths(self, photos: list[_Reduced], number: int, mesh: Mesh, error: float) -> _Depths:
        """Depths of the pixels of a photo; error: of the mesh, px of the reduced photo."""
        camera, grey, counts = photos[number]
        unknown = np.zeros((camera.height, camera.width))
        face, inverse = rasterize_inverse(mesh.vertices, mesh.faces, camera)
        inverse = _extended(inverse, error)
        inverse[~counts] = 0
        rows, columns = np.nonzero(inverse)
        if len(rows) == 0 or not self._neighbors[number]:
            return _Depths(unknown, 1.0, face)
        area = np.s_[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1]
        inverse, grey = np.ascontiguousarray(inverse[area]), np.ascontiguousarray(grey[area])
        warps = [_warp(camera, photos[k].camera, area) for k in self._neighbors[number]]
        typical = float(np.median(inverse[inverse > 0]))
        middle = np.array([inverse.shape[1] / 2, inverse.shape[0] / 2, 1.0])
        step = 1 / max(max(_px_per_inverse(A @ middle, b, typical) for A, b in warps), 1e-300)
        focal = camera.K[0, 0]
        # At most twice as many copies on either side as the largest error has pixels within reach.
        count = int(np.clip(np.ceil(REACH * error * typical / focal / step), HALF_WINDOW, 2 * REACH * LARGEST_ERROR))
        shifts = step * np.arange(-count, count + 1)
        others = [(photos[k].grey, A, b) for k, (A, b) in zip(self._neighbors[number], warps, strict=True)]
        place = self._places(inverse, shifts, others, grey)
        unknown[area] = np.where(_inside(inverse > 0) & (place > 0), inverse + (place - 1 - count) * step, 0.0)
        return _Depths(unknown, step, face)

    def _places(
        self,
        inverse: np.ndarray,
        shifts: np.ndarray,
        others: list[tuple[np.ndarray, np.ndarray, np.ndarray]],
        grey: np.ndarray,
    ) -> np.ndarray:
        """(h, w) float32: places of an area's best correlations with other photos, among shifts (s,) of its inverse depths (h, w).

        Args:
            others: grey levels of the other photos, and the warp into each, see `_warp`.
            grey: (h, w) float32: grey levels of the area.

        Returns:
            Counted from 1, see `_peaks`.
        """
        mean, contrast, second, warped, place = (np.empty_like(grey) for _ in range(5))
        _window_statistics(grey, mean, contrast)
        scores, single = np.full((len(shifts), *grey.shape), -1, np.float32), inverse.astype(np.float32)
        for shift, best in zip(shifts, scores, strict=True):
            self._check()
            second[:] = -1
            for other, A, b in others:
                _warp_photo(other, single, shift, A, b, warped)
                _correlate(grey, mean, contrast, warped, best, second)
            if len(others) > 1:
                best += second  # of the others, those with a worse correlation may see something else
                best /= 2
        _peaks(scores, place)
        return place

    def _points_of(
        self, photos: list[_Reduced], number: int, depths: list[_Depths]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Positions (p, 3), covariances (p, 3, 3), photo (p,) and face (p,) of the points of a photo.

        The depth of another photo must agree within a step.
        """
        camera, (inverse, step, face) = photos[number].camera, depths[number]
        spacing = HALF_WINDOW + 1  # px: the centre of a window belongs to no neighbour's
        row, column = np.mgrid[spacing // 2 : camera.height : spacing, spacing // 2 : camera.width : spacing]
        row, column = row[inverse[row, column] > 0], column[inverse[row, column] > 0]
        at = inverse[row, column]
        rays = np.column_stack([column, row, np.ones(len(row))]) @ np.linalg.inv(camera.image_from_world[:, :3]).T
        positions = camera.center + rays / at[:, None]
        kept = np.zeros(len(positions), dtype=bool)
        for k in self._neighbors[number]:
            other = photos[k].camera
            uv, depth = other.project(positions)
            u, v = np.rint(np.nan_to_num(uv, nan=-1.0)).clip(-1, 1 << 20).astype(int).T
            inside = np.flatnonzero((depth > 0) & (u >= 0) & (v >= 0) & (u < other.width) & (v < other.height))
            there, its_step = depths[k].inverse[v[inside], u[inside]], depths[k].step
            near = np.abs(there - 1 / depth[inside]) < max(step, its_step)
            kept[inside[(there > 0) & near]] = True
        positions, at, face = positions[kept], at[kept], face[row, column][kept]
        sight = (positions - camera.center) / np.linalg.norm(positions - camera.center, axis=1, keepdims=True)
        across = (SIGMA / (at * camera.K[0, 0])) ** 2
        along = (SIGMA * step / at**2) ** 2
        covariance = across[:, None, None] * np.eye(3) + along[:, None, None] * sight[:, :, None] * sight[:, None, :]
        return positions, covariance, np.full(len(positions), number), face


def reduction(camera: Camera, error: float) -> float:
    """Size of the photo of a sweep that allows for an error, px, over that of the photo of a camera."""
    return min(1.0, (MEGAPIXELS * 1e6 / (camera.width * camera.height)) ** 0.5, LARGEST_ERROR / error)


def _reduced(view: View, error: float) -> _Reduced:
    size = (view.camera.width, view.camera.height)
    shrink = reduction(view.camera, error)
    reduced = (max(1, round(size[0] * shrink)), max(1, round(size[1] * shrink)))
    grey = cv2.cvtColor(grey_levels(view.photo.full_depth()), cv2.COLOR_RGB2GRAY)
    if reduced != size:
        grey = cv2.resize(grey, reduced, interpolation=cv2.INTER_AREA)
    grey = grey.astype(np.float32) - np.float32(128)  # for accuracy: sums of squares are in single precision
    counts = np.ones(grey.shape, dtype=bool)
    if view.mask is not None:
        counts = cv2.resize(view.mask.load().astype(np.uint8), reduced, interpolation=cv2.INTER_NEAREST) > 0
        grey[~counts] = 0
    camera = Camera(resizing(size, reduced) @ view.camera.image_from_world, *reduced)
    return _Reduced(camera, grey, counts)


def _spread(faces: np.ndarray) -> np.ndarray:
    """Indices, ascending, of points with these faces (p,) int: at most `POINTS_PER_FACE` of a face, evenly chosen."""
    order = np.argsort(faces, kind="stable")
    _, first, count = np.unique(faces[order], return_index=True, return_counts=True)
    rank = np.arange(len(faces)) - np.repeat(first, count)
    return np.sort(order[rank % np.repeat(-(-count // POINTS_PER_FACE), count) == 0])


def _inside(mask: np.ndarray) -> np.ndarray:
    """A mask (h, w) without the pixels whose windows are cut off at its border."""
    result = np.zeros_like(mask)
    inner = np.s_[HALF_WINDOW:-HALF_WINDOW, HALF_WINDOW:-HALF_WINDOW]
    result[inner] = mask[inner]
    return result


def _extended(inverse: np.ndarray, margin: float) -> np.ndarray:
    """Inverse depths (height, width), those beside the surface, within a margin in px, taken from its nearest pixel."""
    is_empty = inverse == 0
    if is_empty.all() or not is_empty.any():
        return inverse
    distance, label = cv2.distanceTransformWithLabels(
        is_empty.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    of_label = np.zeros(int(label.max()) + 1)
    of_label[label[~is_empty]] = inverse[~is_empty]
    return np.where(distance <= margin, of_label[label], 0.0)


def _warp(camera: Camera, other: Camera, area: tuple[slice, slice]) -> tuple[np.ndarray, np.ndarray]:
    """A (3, 3) and b (3,): A (x, y, 1) + inverse depth * b is the pixel (x, y) of an area in the other photo, homogeneous."""
    shift = np.array([[1.0, 0, area[1].start], [0, 1, area[0].start], [0, 0, 1]])
    P = other.image_from_world
    A = P[:, :3] @ np.linalg.inv(camera.image_from_world[:, :3]) @ shift
    return A, P[:, :3] @ camera.center + P[:, 3]


def _px_per_inverse(a: np.ndarray, b: np.ndarray, inverse: float) -> float:
    """Motion in px per change of the inverse depth of a pixel a + inverse * b (3,), homogeneous."""
    h = a + inverse * b
    return float(np.linalg.norm(b[:2] - h[:2] / h[2] * b[2]) / abs(h[2]))


@njit(cache=True, nogil=True, error_model="numpy")
def _warp_photo(photo, inverse, shift, A, b, result):
    """Grey levels of a photo (H, W) at the pixels (h, w) with these inverse depths and a shift of them; 0 where unknown."""
    height, width = inverse.shape
    right, bottom, tiny = np.float32(photo.shape[1] - 1.001), np.float32(photo.shape[0] - 1.001), np.float32(1e-6)
    a00, a10, a20 = np.float32(A[0, 0]), np.float32(A[1, 0]), np.float32(A[2, 0])
    b0, b1, b2, shift = np.float32(b[0]), np.float32(b[1]), np.float32(b[2]), np.float32(shift)
    u, v, counts = np.empty(width, np.float32), np.empty(width, np.float32), np.empty(width, np.float32)
    for y in range(height):
        u0, v0 = np.float32(A[0, 1] * y + A[0, 2]), np.float32(A[1, 1] * y + A[1, 2])
        w0 = np.float32(A[2, 1] * y + A[2, 2])
        for x in range(width):  # apart from the loop that reads the photo, so that it vectorises
            place, at = np.float32(x), inverse[y, x] + shift
            w = a20 * place + w0 + at * b2
            scale = np.float32(1) / max(w, tiny)
            p, q = (a00 * place + u0 + at * b0) * scale, (a10 * place + v0 + at * b1) * scale
            u[x], v[x] = min(max(p, np.float32(0)), right), min(max(q, np.float32(0)), bottom)
            is_inside = (inverse[y, x] > 0) & (w > tiny) & (p == u[x]) & (q == v[x])
            counts[x] = np.float32(1) if is_inside else np.float32(0)
        for x in range(width):
            i, j = np.int32(u[x]), np.int32(v[x])
            s, t = u[x] - np.float32(i), v[x] - np.float32(j)
            upper = photo[j, i] + s * (photo[j, i + 1] - photo[j, i])
            lower = photo[j + 1, i] + s * (photo[j + 1, i + 1] - photo[j + 1, i])
            result[y, x] = counts[x] * (upper + t * (lower - upper))


@njit(cache=True, nogil=True, error_model="numpy")
def _window_statistics(picture, mean, contrast):
    """Mean of the window of each pixel, and 1 / its standard deviation (h, w) float32, with `NOISE` added to the variance.

    Windows are cut off at the border of the picture; what is cut off counts as 0, a mean grey level.
    """
    height, width = picture.shape
    size = 2 * HALF_WINDOW + 1
    part, noise = np.float32(1 / (size * size)), np.float32(NOISE)
    sums = np.zeros((2, width + 2 * HALF_WINDOW), np.float32)  # by column: of grey levels and of their squares
    for y in range(height):
        for x in range(width):
            sums[0, x + HALF_WINDOW] = sums[1, x + HALF_WINDOW] = 0
        for row in range(max(0, y - HALF_WINDOW), min(height, y + HALF_WINDOW + 1)):
            for x in range(width):
                sums[0, x + HALF_WINDOW] += picture[row, x]
                sums[1, x + HALF_WINDOW] += picture[row, x] * picture[row, x]
        for x in range(width):
            total = squares = np.float32(0)
            for k in range(size):
                total += sums[0, x + k]
                squares += sums[1, x + k]
            mean[y, x] = total * part
            contrast[y, x] = 1 / np.sqrt(squares * part - mean[y, x] * mean[y, x] + noise)


@njit(cache=True, nogil=True, error_model="numpy")
def _correlate(a, mean, contrast, b, best, second):
    """Normalized cross-correlation of the windows of two pictures (h, w) float32, entered among the best two (h, w) so far.

    Args:
        mean, contrast: `_window_statistics` of `a`.
    """
    height, width = a.shape
    size = 2 * HALF_WINDOW + 1
    part, noise = np.float32(1 / (size * size)), np.float32(NOISE)
    sums = np.zeros((3, width + 2 * HALF_WINDOW), np.float32)  # by column: of b, b b, a b
    for y in range(height):
        for x in range(width):
            sums[0, x + HALF_WINDOW] = sums[1, x + HALF_WINDOW] = sums[2, x + HALF_WINDOW] = 0
        for row in range(max(0, y - HALF_WINDOW), min(height, y + HALF_WINDOW + 1)):
            for x in range(width):
                q = b[row, x]
                sums[0, x + HALF_WINDOW] += q
                sums[1, x + HALF_WINDOW] += q * q
                sums[2, x + HALF_WINDOW] += a[row, x] * q
        for x in range(width):
            B = BB = AB = np.float32(0)
            for k in range(size):
                B += sums[0, x + k]
                BB += sums[1, x + k]
                AB += sums[2, x + k]
            B *= part
            variance = BB * part - B * B + noise
            value = (AB * part - mean[y, x] * B) * contrast[y, x] / np.sqrt(variance)
            second[y, x] = max(second[y, x], min(best[y, x], value))
            best[y, x] = max(best[y, x], value)


@njit(cache=True, nogil=True, error_model="numpy")
def _peaks(scores, place):
    """The place of the largest of scores (k, h, w).

    Args:
        place: (h, w) float32, out: by a parabola, counted from 1; 0 at either end and where the score is at most 0.
    """
    count, height, width = scores.shape
    best, top = np.empty(width, np.int64), np.empty(width, np.float32)
    for y in range(height):
        for x in range(width):
            best[x], top[x] = 0, scores[0, y, x]
        for k in range(1, count):
            for x in range(width):
                if scores[k, y, x] > top[x]:
                    top[x], best[x] = scores[k, y, x], k
        for x in range(width):
            k = best[x]
            place[y, x] = 0
            if 0 < k < count - 1 and top[x] > 0:
                before, after = scores[k - 1, y, x], scores[k + 1, y, x]
                curvature = before - 2 * top[x] + after
                place[y, x] = k + 1 + (0.5 * (before - after) / curvature if curvature < 0 else 0.0)
