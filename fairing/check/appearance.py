"""What the photos show of each face: its mean grey level, and how much texture there is to hold on to."""

from dataclasses import dataclass

import cv2
import numpy as np

from fairing.cells.visibility import Visibility, depth_map
from fairing.scene import Scene

_STEP = 2
"""Every so many pixels are looked at, in both directions."""
_FEWEST = 10
"""Pixels that a photo must show of a face to be asked about it."""
_MOST = 20_000
"""Faces that tell the photos' exposures: evenly chosen ones stand for all."""


@dataclass(frozen=True, eq=False)
class Appearance:
    """Attributes:
    mean: (m, V) float: mean grey level of each face in each photo, NaN where too little is seen.
    texture: (m,) float: grey levels a pixel: rms gradient after a blur of 1 px, all photos together; NaN if unseen.
    weakest: (m,) float: the same along the direction in which the grey levels change least. Where it is near 0 but
        `texture` is not, the face can slide along its stripes unseen (the aperture problem).
    """

    mean: np.ndarray
    texture: np.ndarray
    weakest: np.ndarray


def measure_appearance(scene: Scene, reasons: np.ndarray) -> Appearance:
    """Look at every face in the photos that see it.

    Args:
        reasons: (m, V) `Visibility` of every face in every view.

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
        grey = cv2.cvtColor(view.photo.load(), cv2.COLOR_RGB2GRAY).astype(np.float32)
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
        enough = pixels >= _FEWEST
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
    """(V,) float: how bright each photo is beside the median photo, from faces that several photos show; NaN if unknown.

    Robust alternating fit of log(mean) = face + photo, so that photos of other parts of the scene compare fairly.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        log = np.log(np.where(mean > 2, mean, np.nan))
    known = np.isfinite(log)
    log = log[known.sum(axis=1) >= 2]
    log = log[:: -(-len(log) // _MOST) or 1]
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
    """Median of what is known; NaN where nothing is."""
    known = np.isfinite(values).any(axis=axis)
    result = np.full(values.shape[1 - axis], np.nan)
    result[known] = np.nanmedian(np.compress(known, values, axis=1 - axis), axis=axis)
    return result
