"""A photo of the corner smoothed by OpenCV, as an oracle for sampled cells."""

import cv2
import numpy as np

from tests.small_scene import photos


def blurred(view: int, blur: float) -> np.ndarray:
    """(h, w): the photo smoothed by OpenCV's Gaussian."""
    grey = photos()[view][..., 0].astype(np.float32)
    size = 2 * int(np.ceil(4 * blur)) + 1
    return cv2.GaussianBlur(grey, (size, size), blur, borderType=cv2.BORDER_REFLECT_101).astype(np.float64)
