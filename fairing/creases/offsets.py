"""Offsets of creases: distances to the strongest image edge nearby, along the normal of the projected crease.

Samples along a crease give profiles across it; profiles of a segment are averaged as signed derivatives, so that only what
runs along the segment remains, and the peak of the average is located with subpixel accuracy.
"""

from typing import NamedTuple

import cv2
import numpy as np

from fairing.camera import Camera
from fairing.creases.edges import Creases
from fairing.geometry.normals import face_normals
from fairing.geometry.rasterize import rasterize

SMOOTHING = 0.7  # sigma, px, of the photo
SPACING = 1.5  # px between samples along a crease
SEGMENT = 14.0  # px
MARGIN = 3.0  # px left out at both ends of a crease, at most a quarter of it
MIN_LENGTH = 6.0  # px
MAX_LENGTH = 5000.0  # px: longer projections come from vertices close to the camera's plane
MIN_SAMPLES = 4  # of a segment
MIN_FACING = 0.05  # cosine: one of the two faces is seen at least so obliquely
HIDDEN = 1.5  # px' worth of depth (depth / focal length) behind the nearest surface
BACKGROUND = 1e30  # depth, world units
STEP = 0.25  # px between samples of a profile
HALF_STEPS = 2  # the derivative is taken over +- this many steps
CORRELATION = 2.5  # px along the crease over which residuals of the profiles agree
MIN_NOISE, MIN_CONTRAST = 0.5, 1.5  # grey levels per px
MIN_SIGNIFICANCE = 3.0  # of a peak, in units of its noise; three times as much has full weight
LEAST_UNIQUENESS = 0.05  # weight of a peak that another one equals
CONCAVE_WEIGHT = 0.3  # concave creases have contact shadows and reflections beside them (ledger: creases)
BATCH = 28_000  # samples of a profile taken at a time; OpenCV maps at most 32,767 rows


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
        photo: (height, width, 3) uint8.
        vertices: (n, 3) float, world units.
        faces: (m, 3) int.
        reach: largest offset, px.
    """
    uv, depth = camera.project(vertices)
    first, second = creases.ends.T
    direction = uv[second] - uv[first]
    with np.errstate(invalid="ignore"):
        length = np.linalg.norm(direction, axis=1)
        shown = (depth[first] > 0) & (depth[second] > 0) & (length > MIN_LENGTH) & (length < MAX_LENGTH)
    shown &= _facing(camera, vertices, faces, creases) > MIN_FACING
    seen = np.flatnonzero(shown)
    if len(seen) == 0:
        return _none()
    image = cv2.GaussianBlur(photo.astype(np.float32), (0, 0), SMOOTHING)
    nearest = rasterize(vertices, faces, camera)[1]
    farthest = cv2.dilate(np.minimum(nearest, BACKGROUND).astype(np.float32), np.ones((3, 3)))
    count = np.maximum(MIN_SAMPLES, (length[seen] / SPACING).astype(int))
    batches = np.array_split(seen, np.flatnonzero(np.diff(np.cumsum(count) // BATCH)) + 1)
    parts = [_measured(image, farthest, camera, vertices, uv, depth, creases, part, reach) for part in batches]
    return Offsets(*(np.concatenate(values) for values in zip(*parts, strict=True)))


def _facing(camera: Camera, vertices: np.ndarray, faces: np.ndarray, creases: Creases) -> np.ndarray:
    """(e,) float: the larger cosine between the line of sight and the normals of the two faces, by magnitude."""
    normals = face_normals(vertices, faces)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    sight = camera.center - vertices[creases.ends].mean(axis=1)
    sight /= np.maximum(np.linalg.norm(sight, axis=1, keepdims=True), 1e-300)
    return np.abs((normals[creases.faces] * sight[:, None]).sum(axis=2)).max(axis=1)


def _measured(
    image: np.ndarray,
    farthest: np.ndarray,
    camera: Camera,
    vertices: np.ndarray,
    uv: np.ndarray,
    depth: np.ndarray,
    creases: Creases,
    ids: np.ndarray,
    reach: float,
) -> Offsets:
    """Offsets of creases `ids` (c,) in one batch; see `measure_offsets`.

    Args:
        farthest: (height, width) float32: the largest depth of the surface around each pixel.
        uv, depth: (n, 2) and (n,) float: the vertices in the photo.
    """
    first, second = creases.ends[ids].T
    direction = uv[second] - uv[first]
    length = np.linalg.norm(direction, axis=1)
    across = np.column_stack([-direction[:, 1], direction[:, 0]]) / length[:, None]
    count = np.maximum(MIN_SAMPLES, (length / SPACING).astype(int))
    row = np.repeat(np.arange(len(ids)), count)
    k = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
    margin = np.minimum(MARGIN / length, 0.25)[row]
    in_image = margin + (1 - 2 * margin) * (k + 0.5) / count[row]
    # Along the image of a line, inverse depth is linear.
    at_first, at_second = 1 / depth[first][row], 1 / depth[second][row]
    inverse = (1 - in_image) * at_first + in_image * at_second
    along = in_image * at_second / inverse
    pixels = uv[first][row] + in_image[:, None] * direction[row]
    segment = (k * np.maximum(1, np.rint(length / SEGMENT).astype(int))[row]) // count[row]

    border = reach + 3
    height, width = farthest.shape
    inside = ((pixels > border) & (pixels < [width - 1 - border, height - 1 - border])).all(axis=1)
    x, y = np.rint(pixels[inside]).astype(int).T
    tolerance = HIDDEN / np.linalg.norm(camera.image_from_world[0, :3])
    usable = inside.copy()
    usable[inside] = farthest[y, x] * inverse[inside] > 1 - tolerance
    row, along, pixels, segment = row[usable], along[usable], pixels[usable], segment[usable]
    starts = (
        np.flatnonzero(np.r_[True, (np.diff(row) != 0) | (np.diff(segment) != 0)]) if len(row) else np.zeros(0, int)
    )
    sizes = np.diff(np.r_[starts, len(row)])
    if not (sizes >= MIN_SAMPLES).any():
        return _none()

    steps = round((reach + 2 * HALF_STEPS * STEP) / STEP)
    places = np.arange(-steps, steps + 1) * STEP
    at = (pixels[:, None] + places[:, None] * across[row][:, None]).astype(np.float32)
    profile = cv2.remap(image, at[..., 0], at[..., 1], cv2.INTER_LINEAR)
    slope = (profile[:, 2 * HALF_STEPS :] - profile[:, : -2 * HALF_STEPS]).astype(np.float64)
    mean = np.add.reduceat(slope, starts) / sizes[:, None, None]
    variance = np.maximum(np.add.reduceat(slope**2, starts) / sizes[:, None, None] - mean**2, 0)
    independent = np.maximum(1.0, sizes * SPACING / CORRELATION)
    noise = np.sqrt(variance.sum(axis=2) / independent[:, None] + MIN_NOISE**2)
    offset, weight = _peaks(np.linalg.norm(mean, axis=2), noise, places[HALF_STEPS:-HALF_STEPS], reach)
    centre = np.add.reduceat(along, starts) / sizes
    own = row[starts]
    point = vertices[first[own]] + centre[:, None] * (vertices[second[own]] - vertices[first[own]])
    px_per_move = np.einsum("si,sij->sj", across[own], camera.J_image_wrt_point(point))
    weight *= np.where(creases.is_concave[ids[own]], CONCAVE_WEIGHT, 1.0)
    kept = (sizes >= MIN_SAMPLES) & (weight > 0)
    return Offsets(ids[own][kept], centre[kept], px_per_move[kept], offset[kept], weight[kept])


def _peaks(contrast: np.ndarray, noise: np.ndarray, places: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Place and weight (s,) of the largest local maximum of each profile (s, p) within the reach; weight 0 without one."""
    is_peak = np.zeros(contrast.shape, dtype=bool)
    inner = contrast[:, 1:-1]
    is_peak[:, 1:-1] = (inner >= contrast[:, :-2]) & (inner > contrast[:, 2:])
    score = np.where(is_peak & (np.abs(places) <= reach), contrast, 0.0)
    rows = np.arange(len(contrast))
    best = np.clip(score.argmax(axis=1), 1, len(places) - 2)
    left, top, right = (contrast[rows, best + shift] for shift in (-1, 0, 1))
    curvature = left - 2 * top + right
    shift = np.where(curvature < 0, 0.5 * (left - right) / np.where(curvature < 0, curvature, 1.0), 0.0)
    significance = top / noise[rows, best]
    others = score.copy()
    for neighbour in (-1, 0, 1):
        others[rows, best + neighbour] = 0
    uniqueness = np.clip(1 - others.max(axis=1) / np.maximum(top, 1e-300), LEAST_UNIQUENESS, 1)
    counts = (score[rows, best] > 0) & (significance > MIN_SIGNIFICANCE) & (top > MIN_CONTRAST)
    weight = np.where(counts, np.minimum(significance / MIN_SIGNIFICANCE, 3) / 3 * uniqueness, 0.0)
    return places[best] + STEP * shift, weight


def _none() -> Offsets:
    return Offsets(np.zeros(0, dtype=int), np.zeros(0), np.zeros((0, 3)), np.zeros(0), np.zeros(0))
