"""A camera's photo as the background of the 3D view.

viser 1.1.1 stretches a background image to the window, and its cameras have a centred principal point and square pixels.
So the photo is resampled to the window, and the window's camera gets a matching field of view.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from fairing.camera import Camera

AVERAGED_BELOW = 0.75  # photo pixels are averaged before they are resampled at less than this scale


@dataclass(frozen=True)
class PhotoFit:
    """How a photo fits into a window.

    Attributes:
        fov: vertical field of view of the window's camera, radians.
        photo_from_window: (2, 3) float affine map from window pixels to photo pixels; pixel centres at integers.
    """

    fov: float
    photo_from_window: np.ndarray


def fit_photo(camera: Camera, width: int, height: int) -> PhotoFit:
    """Fit the whole photo into a window of `width` x `height` px.

    The affine map of the photo compensates unequal focal lengths, skew and a principal point off the centre.
    """
    K = camera.K
    w, h = camera.width, camera.height
    corners = np.array([[-0.5, -0.5, 1], [w - 0.5, -0.5, 1], [-0.5, h - 0.5, 1], [w - 0.5, h - 0.5, 1]])
    reach = np.abs((np.linalg.inv(K) @ corners.T)[:2]).max(axis=1)
    focal = min(width / 2 / reach[0], height / 2 / reach[1])
    A = K[:2, :2] / focal
    middle = np.array([width / 2 - 0.5, height / 2 - 0.5])
    return PhotoFit(float(2 * np.arctan(height / 2 / focal)), np.column_stack([A, K[:2, 2] - A @ middle]))


def photo_background(
    photo: np.ndarray, fit: PhotoFit, width: int, height: int, ground: tuple[int, int, int]
) -> np.ndarray:
    """(height, width, 3) uint8: the photo (h, w, 3) uint8 as it lies in the window, surrounded by `ground`."""
    shrink = 1 / max(1.0, float(np.linalg.norm(fit.photo_from_window[:, 0])))
    M = fit.photo_from_window.copy()
    if shrink < AVERAGED_BELOW:  # the affine map reads single pixels
        size = (max(1, round(photo.shape[1] * shrink)), max(1, round(photo.shape[0] * shrink)))
        scale = np.array([size[0] / photo.shape[1], size[1] / photo.shape[0]])
        photo = cv2.resize(photo, size, interpolation=cv2.INTER_AREA)
        M = M * scale[:, None]
        M[:, 2] += 0.5 * (scale - 1)
    return cv2.warpAffine(
        photo,
        M,
        (width, height),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=ground,
    )
