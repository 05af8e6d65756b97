"""Software drawing of a textured mesh from a camera, for pictures and videos without a graphics card."""

import cv2
import numba
import numpy as np

from fairing.camera import Camera
from fairing.geometry.rasterize import rasterize

RGB = tuple[int, int, int]
OVERSAMPLING = 2
"""Pixels drawn per pixel and axis, for smooth outlines."""


class Drawing:
    """One mesh in one camera, which can be drawn with any texture.

    Args:
        vertices: (n, 3) float, world units.
        faces: (m, 3) int.
        camera: its size is the size of the pictures.
    """

    def __init__(self, vertices: np.ndarray, faces: np.ndarray, camera: Camera) -> None:
        self._size = (camera.width, camera.height)
        fine = camera.resized(OVERSAMPLING * camera.width, OVERSAMPLING * camera.height)
        self._face, _ = rasterize(vertices, faces, fine)
        # A pixel x is a positive multiple of P (a, b, c) w for the weights w of its face's corners.
        seen = np.unique(self._face[self._face >= 0])
        P = fine.image_from_world
        corners = np.swapaxes(vertices[faces[seen]] @ P[:, :3].T + P[:, 3], 1, 2)
        self._weights = np.zeros((len(faces), 3, 3))
        self._weights[seen] = np.linalg.inv(corners)

    def textured(self, uv: np.ndarray, image: np.ndarray, background: RGB) -> np.ndarray:
        """The picture, (h, w, 3) uint8, RGB.

        Args:
            uv: (m, 3, 2) float: texture coordinates of the faces' corners, 0 to 1, origin at the top left.
            image: (h', w', 3) uint8, the texture.
            background: colour outside the mesh.
        """
        picture = np.empty((*self._face.shape, 3), dtype=np.uint8)
        picture[:] = background
        _paint(self._face, self._weights, np.ascontiguousarray(uv, dtype=np.float64), image, picture)
        return cv2.resize(picture, self._size, interpolation=cv2.INTER_AREA)


@numba.njit(cache=True, nogil=True)
def _paint(face_id, weights, uv, image, picture):
    """Bilinear texels with correct perspective, into `picture`.

    Args:
        weights: (m, 3, 3): multiplied by (x, y, 1) they are proportional to the barycentric weights of the corners.
    """
    height, width = image.shape[:2]
    for y in range(face_id.shape[0]):
        for x in range(face_id.shape[1]):
            f = face_id[y, x]
            if f < 0:
                continue
            total, u, v = 0.0, 0.0, 0.0
            for j in range(3):
                w = weights[f, j, 0] * x + weights[f, j, 1] * y + weights[f, j, 2]
                total += w
                u += w * uv[f, j, 0]
                v += w * uv[f, j, 1]
            column = min(max(u / total * width - 0.5, 0.0), width - 1.001)
            row = min(max(v / total * height - 0.5, 0.0), height - 1.001)
            i, j0 = int(row), int(column)
            fy, fx = row - i, column - j0
            for channel in range(3):
                upper = (1 - fx) * image[i, j0, channel] + fx * image[i, j0 + 1, channel]
                lower = (1 - fx) * image[i + 1, j0, channel] + fx * image[i + 1, j0 + 1, channel]
                picture[y, x, channel] = np.uint8((1 - fy) * upper + fy * lower + 0.5)
