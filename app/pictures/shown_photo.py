"""Photo as shown in the page: masked areas are dark and tinted pink."""

import numpy as np

from app.palette import REJECTED
from fairing.scene import View

MASKED_BRIGHTNESS = 0.35  # relative brightness of masked areas
MASKED_TINT = 0.25  # share of the pink added to them


def shown_photo(view: View) -> np.ndarray:
    """The photo of a view, (h, w, 3) uint8 RGB.

    Raises:
        InputError: the photo or its mask cannot be read.
    """
    photo = view.photo.load()
    if view.mask is None:
        return photo
    out = ~view.mask.load()
    shown = photo.copy()
    shown[out] = np.round(MASKED_BRIGHTNESS * photo[out] + MASKED_TINT * np.array(REJECTED)).astype(np.uint8)
    return shown
