"""The eight orientations of a photo, numbered as EXIF's tag Orientation: how to turn the stored pixels upright.

1: as stored; 2: mirrored left to right; 3: turned by 180 degrees; 4: mirrored top to bottom; 5: transposed; 6: turned by 90
degrees clockwise; 7: transposed along the other diagonal; 8: turned by 90 degrees counter-clockwise.
"""

import numpy as np

TAG = 0x0112
AS_STORED = 1
INVERSE = {1: 1, 2: 2, 3: 3, 4: 4, 5: 5, 6: 8, 7: 7, 8: 6}
"""The orientation that undoes one."""
_FIRST_TRANSPOSED = 5


def swaps_sides(orientation: int) -> bool:
    """Whether width and height change places."""
    return orientation >= _FIRST_TRANSPOSED


def turned_size(size: tuple[int, int], orientation: int) -> tuple[int, int]:
    """(width, height) of the turned photo from that of the stored one."""
    return (size[1], size[0]) if swaps_sides(orientation) else size


def turned(pixels: np.ndarray, orientation: int) -> np.ndarray:
    """The turned photo, contiguous, from the stored one: (height, width, ...)."""
    if orientation in (3, 4, 6, 7):
        pixels = pixels[::-1]
    if orientation in (2, 3, 7, 8):
        pixels = pixels[:, ::-1]
    return np.ascontiguousarray(pixels.swapaxes(0, 1) if swaps_sides(orientation) else pixels)
