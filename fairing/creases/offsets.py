"""Offsets of creases: distances to the strongest image edge nearby, along the normal of the projected crease.

Samples along a crease give profiles across it; profiles of a segment are averaged as signed derivatives, so that only what
runs along the segment remains, and the peak of the average is located with subpixel accuracy.
"""

from typing import NamedTuple

import cv2
import numpy as np
from numba import njit

from fairing.camera import Camera
from fairing.creases.edges import Creases
from fairing.geometry.rasterize import rasterize_inverse

SEGMENT = 14.0  # px; creases of half of it, and segments of which half is visible, are measured
STEP = 0.5  # px between samples of a profile; its derivative is the difference of the neighbours
# Of a peak, in units of its noise; five times as much has full weight (ledger: weights of peaks).
MIN_SIGNIFICANCE = 3.0
CONCAVE_WEIGHT = 0.3  # concave creases have contact shadows and reflections beside them (ledger: creases)


class Offsets(NamedTuple):
    """Measured segments of creases.

    Attributes:
        crease: (s,) int: index of the crease.
        along: (s,) float: place of the segment on the crease, 0 at its first end, 1 at its second.
        px_per_move: (s, 3) float: motion across the crease in the photo, px per world unit of the place.
        offset: (s,) float: signed distance to the image edge, px.
        weight: (s,) float: 0 to 1.
    """

    crease: np.ndarray
    along: np.ndarray
    px_per_move: np.ndarray
    offset: np.ndarray
    weight: np.ndarray


def measure_offsets(
    photo: np.ndarray, camera: Camera, vertices: np.ndarray, faces: np.ndarray, creases: Creases, reach: float
) -> Offsets:
    """Offsets of the creases that a photo shows.

    Args:
        photo: (height, width, 3) uint8 or float32, grey levels.
        vertices: (n, 3) float, world units.
        faces: (m, 3) int.
        reach: largest offset, px.
    """
    uv, depth = camera.project(vertices)
    first, second = creases.ends.T
    direction = uv[second] - uv[first]
    with np.errstate(invalid="ignore"):
        length = np.linalg.norm(direction, axis=1)
        # Longer than the photo's sides together: from vertices close to the camera's plane.
        shown = (length >= SEGMENT / 2) & (length < camera.width + camera.height)
        shown &= (depth[first] > 0) & (depth[second] > 0)
    seen = np.flatnonzero(shown)
    if len(seen) == 0:
        return _none()
    kernel = cv2.getGaussianKernel(7, 0.7, cv2.CV_32F)  # width and sigma, px
    image = cv2.sepFilter2D(photo, cv2.CV_32F, kernel, kernel)
    inverse_depth = rasterize_inverse(vertices, faces, camera)[1]
    farthest = cv2.erode(inverse_depth.astype(np.float32), np.ones((3, 3)))
    projected = _Projected(camera, vertices, uv, depth)
    places = _places(reach)
    batch = np.cumsum(length[seen].astype(int)) // 28_000  # OpenCV maps at most 32,767 rows
    batches = np.array_split(seen, np.flatnonzero(np.diff(batch)) + 1)
    parts = []
    for ids in batches:
        samples = _samples_along(projected, creases.ends[ids], farthest, places[-1])
        parts.append(_measured(image, projected, creases, ids, samples, places))
    return Offsets(*(np.concatenate(values) for values in zip(*parts, strict=True)))


def _places(reach: float) -> np.ndarray:
    """Samples of a profile, px from the crease: up to the reach, and what the derivative there needs."""
    steps = round(reach / STEP) + 2
    return np.arange(-steps, steps + 1) * STEP


class _Projected(NamedTuple):
    """Vertices in a photo: positions (n, 3), world units; pixels `uv` (n, 2); depths (n,), world units."""

    camera: Camera
    vertices: np.ndarray
    uv: np.ndarray
    depth: np.ndarray


class _Samples(NamedTuple):
    """Visible samples along creases, those of a segment one after another.

    Attributes:
        row: (p,) int: index of the crease.
        along: (p,) float: place on the crease, 0 to 1.
        pixels: (p, 2) float.
        across: (p, 2) float: unit normal of the projected crease.
        starts, sizes: (s,) int: of the segments.
    """

    row: np.ndarray
    along: np.ndarray
    pixels: np.ndarray
    across: np.ndarray
    starts: np.ndarray
    sizes: np.ndarray


def _samples_along(projected: _Projected, ends: np.ndarray, farthest: np.ndarray, border: float) -> _Samples:
    """Samples of creases with these ends (c, 2), one a px, where they are visible.

    Args:
        farthest: (height, width) float32: the least inverse depth of the surface around each pixel, 0 beside the surface.
        border: px: samples closer to the border of the photo are left out.
    """
    first, second = ends.T
    direction = projected.uv[second] - projected.uv[first]
    length = np.linalg.norm(direction, axis=1)
    count = length.astype(int)
    row = np.repeat(np.arange(len(ends)), count)
    k = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
    margin = np.minimum(2 / length, 0.25)[row]  # left out at both ends, where other creases meet it
    in_image = margin + (1 - 2 * margin) * (k + 0.5) / count[row]
    # Along the image of a line, inverse depth is linear.
    at_first, at_second = 1 / projected.depth[first][row], 1 / projected.depth[second][row]
    inverse = (1 - in_image) * at_first + in_image * at_second
    along = in_image * at_second / inverse
    pixels = projected.uv[first][row] + in_image[:, None] * direction[row]
    segment = (k * np.maximum(1, np.rint(length / SEGMENT).astype(int))[row]) // count[row]

    height, width = farthest.shape
    visible = np.all((pixels > border) & (pixels < [width - 1 - border, height - 1 - border]), axis=1)
    x, y = np.rint(pixels[visible]).astype(int).T
    # Up to one px, depth / focal length, behind the nearest surface.
    tolerance = 1 / np.linalg.norm(projected.camera.image_from_world[0, :3])
    visible[visible] = inverse[visible] > (1 - tolerance) * farthest[y, x]
    row, segment = row[visible], segment[visible]
    is_first = np.r_[True, (np.diff(row) != 0) | (np.diff(segment) != 0)][: len(row)]
    starts = np.flatnonzero(is_first)
    across = np.column_stack([-direction[:, 1], direction[:, 0]]) / length[:, None]
    return _Samples(row, along[visible], pixels[visible], across[row], starts, np.diff(np.r_[starts, len(row)]))


def _measured(
    image: np.ndarray, projected: _Projected, creases: Creases, ids: np.ndarray, samples: _Samples, places: np.ndarray
) -> Offsets:
    """Offsets of the segments of creases `ids` (c,); see `measure_offsets`.

    Args:
        image: (height, width, 3) float32: the smoothed photo.
        places: see `_places`.
    """
    row, along, pixels, across, starts, sizes = samples
    if len(row) == 0:
        return _none()
    x, y = _places_across(pixels, across, places)
    profile = cv2.remap(image, x, y, cv2.INTER_LINEAR)
    contrast, variance = _slopes(profile, starts, sizes)
    noise = np.sqrt(variance / np.maximum(1.0, sizes / 3)[:, None])  # residuals of neighbouring profiles agree
    offset, weight = _peaks(contrast, noise, places[1:-1])
    centre, own = np.add.reduceat(along, starts) / sizes, ids[row[starts]]
    first, second = projected.vertices[creases.ends[own]].transpose(1, 0, 2)
    J = projected.camera.J_image_wrt_point(first + centre[:, None] * (second - first))
    px_per_move = np.einsum("si,sij->sj", across[starts], J)
    weight *= np.where(creases.is_concave[own], CONCAVE_WEIGHT, 1.0)
    kept = (sizes >= SEGMENT / 2) & (weight > 0)
    return Offsets(own[kept], centre[kept], px_per_move[kept], offset[kept], weight[kept])


@njit(cache=True, nogil=True)
def _places_across(pixels, across, places):
    """Pixels x and y, (p, q) float32 each: places (q,) px along the unit normals (p, 2) through pixels (p, 2)."""
    x, y = np.empty((2, len(pixels), len(places)), dtype=np.float32)
    for k in range(len(pixels)):
        for j in range(len(places)):
            x[k, j] = pixels[k, 0] + places[j] * across[k, 0]
            y[k, j] = pixels[k, 1] + places[j] * across[k, 1]
    return x, y


@njit(cache=True, nogil=True)
def _slopes(profile, starts, sizes):
    """Derivatives of the profiles (p, q + 2, 3) by segment, over the three channels.

    Returns:
        Length of their mean (s, q) float64, and the sum of their variances (s, q) float64.
    """
    width = profile.shape[1] - 2
    contrast, variance = np.zeros((len(starts), width)), np.zeros((len(starts), width))
    mean, squares = np.empty((width, 3)), np.empty((width, 3))
    for s in range(len(starts)):
        mean[:] = 0.0
        squares[:] = 0.0
        for k in range(starts[s], starts[s] + sizes[s]):
            for j in range(width):
                for c in range(3):
                    slope = np.float64(profile[k, j + 2, c] - profile[k, j, c])
                    mean[j, c] += slope
                    squares[j, c] += slope * slope
        for j in range(width):
            length = 0.0
            for c in range(3):
                mean[j, c] /= sizes[s]
                length += mean[j, c] ** 2
                variance[s, j] += max(squares[j, c] / sizes[s] - mean[j, c] ** 2, 0.0)
            contrast[s, j] = np.sqrt(length)
    return contrast, variance


def _peaks(contrast: np.ndarray, noise: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Place and weight (s,) of the largest local maximum of each profile (s, p) within the reach; weight 0 without one."""
    reach = places[-1] - STEP
    is_peak = np.zeros(contrast.shape, dtype=bool)
    inner = contrast[:, 1:-1]
    is_peak[:, 1:-1] = (inner >= contrast[:, :-2]) & (inner > contrast[:, 2:])
    score = np.where(is_peak & (np.abs(places) <= reach), contrast, 0.0)
    rows = np.arange(len(contrast))
    best = np.clip(score.argmax(axis=1), 1, len(places) - 2)
    left, top, right = (contrast[rows, best + shift] for shift in (-1, 0, 1))
    curvature = left - 2 * top + right
    shift = np.where(curvature < 0, 0.5 * (left - right) / np.where(curvature < 0, curvature, 1.0), 0.0)
    significance = top / np.maximum(noise[rows, best], 1e-300)
    others = score.copy()
    for neighbour in (-1, 0, 1):
        others[rows, best + neighbour] = 0
    uniqueness = np.clip(1 - others.max(axis=1) / np.maximum(top, 1e-300), 0, 1)  # 0: another one equals it
    counts = (score[rows, best] > 0) & (significance > MIN_SIGNIFICANCE)
    # The variance of a place falls as 1 / significance^2.
    certainty = np.minimum(significance / (5 * MIN_SIGNIFICANCE), 1) ** 2
    weight = np.where(counts, certainty * uniqueness, 0.0)
    return places[best] + STEP * shift, weight


def _none() -> Offsets:
    return Offsets(np.zeros(0, dtype=int), np.zeros(0), np.zeros((0, 3)), np.zeros(0), np.zeros(0))
