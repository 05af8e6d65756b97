"""Photo crops: square windows of photos, and a face warped from one photo into another (the paper's figure 2)."""

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.ndimage import map_coordinates

from fairing.camera import Camera
from fairing.cells.layout import cell_grid
from fairing.cells.scale_space import LUMA

OUTSIDE = 40  # grey level outside the photo
DIMMED = 0.35  # relative brightness of a photo outside the face
MAX_OVERSAMPLING = 4
DIFFERENCE_SAMPLES = 100  # along a leg of the face, see `mean_difference`


@dataclass(frozen=True)
class Window:
    """A square window of a photo, shown as a picture `side` px wide.

    Attributes:
        left, top: column and row of its first pixel in the photo.
        span: side of the window, photo px.
        side: side of the picture, px.
    """

    left: int
    top: int
    span: int
    side: int

    @classmethod
    def around(cls, points: np.ndarray, side: int, margin: float = 0.06, least: float = 16.0) -> "Window":
        """The window around points (n, 2), photo px.

        Args:
            side: of the picture, px.
            margin: on each side, relative to the extent of the points.
            least: minimal side of the window, photo px.
        """
        low, high = points.min(axis=0), points.max(axis=0)
        span = max(int(np.ceil((1 + 2 * margin) * float((high - low).max()))), int(least))
        left, top = np.round((low + high) / 2 + 0.5 - span / 2).astype(int).tolist()
        return cls(left, top, span, side)

    def place(self, points: np.ndarray) -> np.ndarray:
        """Picture px (..., 2) from photo px (..., 2).

        The origin of picture px is the corner of the picture; that of photo px is the centre of the first pixel.
        """
        return (np.asarray(points) + 0.5 - [self.left, self.top]) * (self.side / self.span)

    def cut(self, photo: np.ndarray) -> np.ndarray:
        """(side, side, 3) uint8: the part of the photo (h, w, 3) uint8 in the window, grey outside the photo."""
        h, w = photo.shape[:2]
        piece = np.full((self.span, self.span, 3), OUTSIDE, dtype=np.uint8)
        x0, x1 = max(0, self.left), min(w, self.left + self.span)
        y0, y1 = max(0, self.top), min(h, self.top + self.span)
        if x0 < x1 and y0 < y1:
            piece[y0 - self.top : y1 - self.top, x0 - self.left : x1 - self.left] = photo[y0:y1, x0:x1]
        method = cv2.INTER_AREA if self.span > self.side else cv2.INTER_CUBIC
        return cv2.resize(piece, (self.side, self.side), interpolation=method)


@dataclass(frozen=True, eq=False)
class FacePair:
    """One face in two photos i and j, within a window of photo j.

    Attributes:
        warped: (side, side, 3) uint8: the face in photo i, warped into photo j.
        own: (side, side, 3) uint8: the face in photo j.
        average: (side, side, 3) uint8: mean of both; the rest of photo j is dimmed.
        outline: (3, 2) float: corners of the face, picture px.
    """

    warped: np.ndarray
    own: np.ndarray
    average: np.ndarray
    outline: np.ndarray


def photo_from_photo(one: Camera, other: Camera, corners: np.ndarray, affine: bool) -> np.ndarray:
    """(3, 3) float: the homography from px of camera `other` to px of camera `one` for points of a face.

    With homogeneous projections M = P [X_0 X_1 X_2; 1 1 1] of the corners (3, 3), world units, a point of barycentric
    weights b projects to M b, so the map is M_one M_other^-1. With `affine` (the paper), M holds the projected corners.
    """

    def projected(camera: Camera) -> np.ndarray:
        if affine:
            return np.vstack([camera.project(corners)[0].T, np.ones(3)])
        return camera.image_from_world[:, :3] @ corners.T + camera.image_from_world[:, 3:]

    return projected(one) @ np.linalg.inv(projected(other))


def face_pair(
    photos: tuple[np.ndarray, np.ndarray],
    cameras: tuple[Camera, Camera],
    corners: np.ndarray,
    window: Window,
    affine: bool,
) -> FacePair:
    """Warp a face from photo i into photo j.

    Args:
        photos, cameras: i and j.
        corners: (3, 3) float, world units, in front of both cameras.
        window: of photo j.
    """
    finer = int(np.clip(np.ceil(window.span / window.side), 1, MAX_OVERSAMPLING))
    side = window.side * finer
    step = window.span / side
    photo_from_picture = np.array(
        [[step, 0, window.left - 0.5 + 0.5 * step], [0, step, window.top - 0.5 + 0.5 * step], [0, 0, 1]]
    )
    H = photo_from_photo(*cameras, corners, affine) @ photo_from_picture
    flags, border = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP, (OUTSIDE,) * 3
    warped = cv2.warpPerspective(photos[0], H, (side, side), flags=flags, borderValue=border)
    own = cv2.warpPerspective(photos[1], photo_from_picture, (side, side), flags=flags, borderValue=border)
    outline = window.place(cameras[1].project(corners)[0])
    inside = np.zeros((side, side), dtype=np.uint8)
    cv2.fillConvexPoly(inside, np.round(finer * outline - 0.5).astype(np.int32), 1)
    size = (window.side, window.side)
    warped, own = (cv2.resize(image, size, interpolation=cv2.INTER_AREA) for image in (warped, own))
    inside_small = cv2.resize(inside.astype(np.float32), size, interpolation=cv2.INTER_AREA)[..., None]
    both = 0.5 * (warped.astype(float) + own)
    return FacePair(
        warped=(inside_small * warped + (1 - inside_small) * 0.5 * OUTSIDE).astype(np.uint8),
        own=(inside_small * own + (1 - inside_small) * DIMMED * own).astype(np.uint8),
        average=(inside_small * both + (1 - inside_small) * DIMMED * own).astype(np.uint8),
        outline=outline,
    )


def mean_difference(
    photos: tuple[np.ndarray, np.ndarray], cameras: tuple[Camera, Camera], corners: np.ndarray, affine: bool
) -> float:
    """Mean absolute difference in luma between a face in two photos, grey levels; `app/web/photos.js` computes the same.

    The samples are spread evenly over the face, independently of any picture's resolution. Only those inside both photos
    count; NaN if there are none.

    Args:
        photos: (h, w, 3) uint8.
        corners: (3, 3) float, world units, in front of both cameras.
        affine: as in `photo_from_photo`.
    """
    a, b = cell_grid(DIFFERENCE_SAMPLES).astype(np.float64)
    weights = np.stack([a, b, 1 - a - b], axis=1)

    def luma(photo: np.ndarray, camera: Camera) -> np.ndarray:
        uv = weights @ camera.project(corners)[0] if affine else camera.project(weights @ corners)[0]
        size = np.array(photo.shape[1::-1])
        low = np.clip(np.floor(uv.min(axis=0)), 0, size - 1).astype(int)
        high = np.clip(np.ceil(uv.max(axis=0)) + 1, low + 1, size).astype(int)
        part = photo[low[1] : high[1], low[0] : high[0]] @ LUMA
        return map_coordinates(part, (uv - low).T[::-1], order=1, mode="constant", cval=np.nan)

    one, other = (luma(photo, camera) for photo, camera in zip(photos, cameras, strict=True))
    apart = np.abs(one - other)
    apart = apart[np.isfinite(apart)]
    return float(apart.mean()) if len(apart) else float("nan")
