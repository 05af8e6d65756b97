"""Linear colours: viser 1.1.1 takes the colours of single line ends and instances as linear, and other colours as sRGB."""

import numpy as np


def linear_from_srgb(colors: np.ndarray) -> np.ndarray:
    """Linear colours (...) uint8, 255 the brightest, from sRGB colours (...) uint8 (IEC 61966-2-1)."""
    encoded = colors / 255
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    return np.rint(255 * linear).astype(np.uint8)
