"""Photo pixels of each pair of face and view, at the level's blur or stronger where samples lie far apart."""

from concurrent.futures import Executor
from typing import NamedTuple

import numpy as np

from fairing.cells.scale_space import ScaleSpace

# A photo sampled every d pixels needs a blur of about d / 2, or its fine detail aliases.
ANTI_ALIASING = 0.5


class PairPhotos(NamedTuple):
    """The photo pixels that the P pairs of face and view read.

    Attributes:
        pixels: flat float32: see `KernelData.pixels`.
        base: (P,) int64: where the pair's photo, or patch of it, starts in `pixels`.
        frame: (P, 4) int64: left and top pixel, width and height of that patch.
        camera: (P,) int64: index of the pair's camera; from V on into `reduced_cameras`.
        reduced_cameras: (r, 3, 4) float: `image_from_world` of photos stored at reduced resolution.
    """

    pixels: np.ndarray
    base: np.ndarray
    frame: np.ndarray
    camera: np.ndarray
    reduced_cameras: np.ndarray


def blur_octaves(spacing: np.ndarray, blur: float) -> np.ndarray:
    """By how many octaves (doublings) a photo must be blurred beyond the level's blur to be sampled without aliasing.

    One whose blur falls short by up to a quarter is used as it is.

    Args:
        spacing: (P,) float: distance of neighbouring samples, px.
        blur: sigma_smooth of the level, px.

    Returns:
        (P,) int64.
    """
    needed = ANTI_ALIASING * spacing / max(blur, 1.0)
    return np.where(needed > 1.25, np.ceil(np.log2(np.maximum(needed, 1.0))), 0).astype(np.int64)


def blur_of_octave(octave: int, blur: float) -> float:
    """sigma of a photo's Gaussian at an octave above the level's blur, px; octave 0 is the level's own blur."""
    return blur if octave == 0 else max(blur, 1.0) * 2.0**octave


def blurred_photos_for_pairs(
    photos: ScaleSpace,
    blur: float,
    cubic: bool,
    spacing: np.ndarray,
    image_from_world: np.ndarray,
    pair_view: np.ndarray,
    pool: Executor,
) -> PairPhotos:
    """Whole photos at the level's blur, and at higher octaves for cells whose samples lie far apart in the photo.

    Args:
        blur: sigma_smooth of the level, px.
        cubic: lay out cubic B-spline coefficients instead of pixels.
        spacing: (P,) float: distance of neighbouring samples of each pair, px.
        image_from_world: (V, 3, 4) float: the views' matrices.
        pair_view: (P,) int: the view of each pair.
        pool: executes several photos at a time.
    """
    octave = blur_octaves(spacing, blur)
    octaves = int(octave.max(initial=0)) + 1
    kinds, kind = np.unique(pair_view * octaves + octave, return_inverse=True)
    requested = [(v, blur_of_octave(o, blur)) for v, o in (divmod(int(k), octaves) for k in kinds)]
    pixels, starts = photos.lay_out(blur, cubic, requested, pool)
    base, frame, camera = (np.zeros(shape, np.int64) for shape in (len(requested), (len(requested), 4), len(requested)))
    reduced = []
    for k, (view, sigma) in enumerate(requested):
        base[k], frame[k, 2:], camera[k] = starts[view, sigma], photos.size_at(view, sigma, blur), view
        factor = photos.reduction(view, sigma, blur)
        if factor > 1:
            camera[k] = len(image_from_world) + len(reduced)
            reduced.append(np.diag([1 / factor, 1 / factor, 1]) @ image_from_world[view])
    return PairPhotos(pixels, base[kind], frame[kind], camera[kind], np.array(reduced).reshape(-1, 3, 4))
