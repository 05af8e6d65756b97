"""What the lens does before the pixels: a slight blur, without which fine texture would turn into moire.

A pixel that is the mean over its square lets through detail finer than it can show, and that false detail differs from
photo to photo: corner A of the cube then ends 0.01 % of the edge off, whatever the engine does. Real lenses blur by a
little more than half a pixel.
"""

import numpy as np
from scipy.ndimage import gaussian_filter1d

from demo_scenes.raycast import photograph
from demo_scenes.surface import Stage
from fairing.camera import Camera

BLUR = 0.6  # sigma, photo pixels
FINENESS = 2  # the image the lens forms is traced so many times finer than the pixels


def expose(stage: Stage, light: np.ndarray, camera: Camera, samples: int, blur: float = BLUR) -> np.ndarray:
    """The photo of a real lens on a noiseless sensor: (height, width, 3) float64, grey levels, not clipped.

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
    for axis in (0, 1):
        image = gaussian_filter1d(image, blur * FINENESS, axis=axis, mode="nearest", truncate=5)
    return image.reshape(camera.height, FINENESS, camera.width, FINENESS, 3).mean(axis=(1, 3))
