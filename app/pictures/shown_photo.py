"""A photo as the page shows it: what its mask leaves out of the count is dark and violet."""

import numpy as np

from app.palette import REJECTED
from fairing.scene import View

LEFT_OF_IT = 0.35  # of the brightness of what does not count
TINT = 0.25  # of the violet


def shown_photo(view: View) -> np.ndarray:
    """(h, w, 3) uint8.

    Raises:
        InputError: photo or mask cannot be read.
    """
    photo = view.photo.load()
    if view.mask is None:
        return photo
    out = ~view.mask.load()
    shown = photo.copy()
    shown[out] = np.round(LEFT_OF_IT * photo[out] + TINT * np.array(REJECTED)).astype(np.uint8)
    return shown
