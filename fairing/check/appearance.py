"""Appearance of the faces in the photos: mean grey level and strength of texture; and the photos' exposures."""

from dataclasses import dataclass

import cv2
import numpy as np

from fairing.cells.depth_map import depth_map
from fairing.cells.visibility import Visibility
from fairing.photo import grey_levels
from fairing.scene import Scene

_STEP = 2
"""Sampling distance in both directions, px."""
_MIN_PIXELS = 10
"""A photo that shows fewer sampled pixels of a face is ignored for its mean."""
_MAX_FACES = 20_000
"""Exposures are estimated from at most this many faces, an even subset."""


@dataclass(frozen=True, eq=False)
class Appearance:
    """Appearance of m faces in V photos.

    Attributes:
        mean: (m, V) float: mean grey level of each face in each photo, NaN where too few pixels show it.
        texture: (m,) float, grey levels / px: rms gradient after a blur of 1 px, over all photos; NaN if unseen.
        weakest: (m,) float, grey levels / px: rms gradient along the direction in which the grey levels change least. Where
            it is near 0 but `texture` is not, the face can slide along its stripes (the aperture problem).
    """

    mean: np.ndarray
    texture: np.ndarray
    weakest: np.ndarray


def measure_appearance(scene: Scene, reasons: np.ndarray) -> Appearance:
    """Measure every face in the photos that see it.

    Args:
        reasons: (m, V) int8: `Visibility` of every face in every view.

    Raises:
        InputError: a photo cannot be decoded.
    """
    n_faces = len(scene.mesh.faces)
    seen = np.isin(reasons, (Visibility.SEEN, Visibility.PARTLY_SEEN, Visibility.SURPLUS))
    mean = np.full(reasons.shape, np.nan)
    tensor = np.zeros((n_faces, 3))
    count = np.zeros(n_faces)
    for v, view in enumerate(scene.views):
        if not seen[:, v].any():
            continue
        face_id = depth_map(scene.mesh.vertices, scene.mesh.faces, view.camera, reduction=_STEP).face_id
        grey = cv2.cvtColor(grey_levels(view.photo.full_depth()), cv2.COLOR_RGB2GRAY).astype(np.float32)
        grey = cv2.GaussianBlur(grey, (0, 0), 1.0)
        # Central differences; Scharr's cross average would only widen them.
        gx, gy = (cv2.Sobel(grey, cv2.CV_32F, dx, 1 - dx, ksize=1, scale=0.5)[::_STEP, ::_STEP] for dx in (1, 0))
        counts = face_id >= 0
        if view.mask is not None:
            counts &= view.mask.load()[::_STEP, ::_STEP]
        counts[counts] = seen[face_id[counts], v]
        ids = face_id[counts]
        pixels = np.bincount(ids, minlength=n_faces)
        total = np.bincount(ids, grey[::_STEP, ::_STEP][counts], minlength=n_faces)
        enough = pixels >= _MIN_PIXELS
        mean[enough, v] = total[enough] / pixels[enough]
        count += pixels
        products = (gx[counts] ** 2, gx[counts] * gy[counts], gy[counts] ** 2)
        for column, product in enumerate(products):
            tensor[:, column] += np.bincount(ids, product, minlength=n_faces)
    known = count > 0
    tensor[known] /= count[known, None]
    tensor[~known] = np.nan
    xx, xy, yy = tensor.T
    smaller = (xx + yy) / 2 - np.sqrt((xx - yy) ** 2 / 4 + xy**2)
    return Appearance(mean, np.sqrt(xx + yy), np.sqrt(np.maximum(smaller, 0)))


def exposures(mean: np.ndarray) -> np.ndarray:
    """Exposure of each photo relative to the median photo, from faces that several photos show.

    Robust alternating fit of log(mean) = face + photo, so that photos of different parts of the scene are comparable.

    Args:
        mean: (m, V) float: mean grey level of each face in each photo, NaN where unknown.

    Returns:
        (V,) float: ratio; NaN if unknown.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        log = np.log(np.where(mean > 2, mean, np.nan))
    known = np.isfinite(log)
    log = log[known.sum(axis=1) >= 2]
    log = log[:: -(-len(log) // _MAX_FACES) or 1]
    gain = np.zeros(mean.shape[1])
    known = np.isfinite(log)
    if not known.any():
        return np.full(mean.shape[1], np.nan)
    for _ in range(10):
        face = _median(log - gain, axis=1)
        gain = _median(log - face[:, None], axis=0)
        gain = np.where(np.isfinite(gain), gain, 0)
    gain[~known.any(axis=0)] = np.nan
    return np.exp(gain - np.nanmedian(gain))


def _median(values: np.ndarray, axis: int) -> np.ndarray:
    """Median of the finite values along an axis; NaN where there are none."""
    known = np.isfinite(values).any(axis=axis)
    result = np.full(values.shape[1 - axis], np.nan)
    result[known] = np.nanmedian(np.compress(known, values, axis=1 - axis), axis=axis)
    return result
