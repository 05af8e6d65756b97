"""Lens blur: a slight blur before sampling, without which fine texture causes moire.

A pixel that is the mean over its square passes detail above the Nyquist frequency, and the alias differs from photo to
photo. Real lenses blur by a little more than half a pixel (ledger: lens blur).
"""

import cv2
import numpy as np

from demo_scenes.raycast import photograph
from demo_scenes.surface import Stage
from fairing.camera import Camera

BLUR = 0.6  # sigma, photo pixels
TRUNCATED_AT = 5  # standard deviations
FINENESS = 2  # samples of the optical image along a pixel's side


def expose(stage: Stage, light: np.ndarray, camera: Camera, samples: int, blur: float = BLUR) -> np.ndarray:
    """The photo through a blurring lens on a noiseless sensor: (height, width, 3) float64, grey levels, not clipped.

    Args:
        light: from `light_lattice(stage)`.
        samples: rays along a pixel's side; a multiple of FINENESS.
        blur: sigma of the lens's blur, photo pixels.
    """
    shift = (FINENESS - 1) / 2
    finer = np.array([[FINENESS, 0, shift], [0, FINENESS, shift], [0, 0, 1]]) @ camera.image_from_world
    image = photograph(
        stage, light, Camera(finer, camera.width * FINENESS, camera.height * FINENESS), samples // FINENESS
    )
    kernel = _gaussian(blur * FINENESS)
    image = cv2.sepFilter2D(image, cv2.CV_64F, kernel, kernel, borderType=cv2.BORDER_REPLICATE)
    return cv2.resize(image, (camera.width, camera.height), interpolation=cv2.INTER_AREA)


def _gaussian(sigma: float) -> np.ndarray:
    """Weights (n,) of a Gaussian up to five standard deviations, their sum 1."""
    radius = int(TRUNCATED_AT * sigma + 0.5)
    weights = np.exp(-0.5 * (np.arange(-radius, radius + 1) / sigma) ** 2)
    return weights / weights.sum()
