"""Rasterization: the visible face and its depth at each pixel (a z-buffer, exact at pixel centres)."""

import numba
import numpy as np

from fairing.camera import Camera
from fairing.util.compiled_only import COMPILED_ONLY

# An edge belongs to both its faces, so that rounding opens no cracks; the nearer face wins, then the lower id.
EDGE_TOLERANCE = 1e-9
LEAST_SLOPING = 0.01  # px: where an edge that is lower meets a row is inaccurate
# Depth test against a depth map: a point is hidden when a surface lies in front of it by more than this many pixels' worth
# of depth (depth / focal length).
HIDDEN_DEPTH = 4.0


def rasterize(vertices: np.ndarray, faces: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Nearest face and its depth at every pixel centre; front and back faces are treated alike.

    Args:
        vertices: (n, 3) float, world units.
        faces: (m, 3) int.
        camera: the camera; its size is the size of the result.

    Returns:
        Face ids (height, width) int32, -1 where there is none, and depths (height, width) float64, world units,
        infinite where there is none. Faces that reach behind the camera are left out.
    """
    face_id, inverse_depth = rasterize_inverse(vertices, faces, camera)
    with np.errstate(divide="ignore"):
        return face_id, 1.0 / inverse_depth


def rasterize_inverse(vertices: np.ndarray, faces: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """`rasterize` with inverse depths, 1 / world units, 0 where there is no face."""
    face_id = np.full((camera.height, camera.width), -1, dtype=np.int32)
    inverse_depth = np.zeros((camera.height, camera.width))
    uv, depth = camera.project(vertices)
    _fill(uv, depth, np.array(faces), face_id, inverse_depth)  # a copy: for read-only arrays numba would compile again
    return face_id, inverse_depth


@numba.njit(nogil=True, **COMPILED_ONLY)
def _row(ax, ay, bx, by, cx, cy, y):
    """The part of a row y that a triangle covers, px, and at least a pixel more on both sides; unlimited if that is unclear."""
    left, right = np.inf, -np.inf
    for x0, y0, x1, y1 in ((ax, ay, bx, by), (bx, by, cx, cy), (cx, cy, ax, ay)):
        if min(y0, y1) <= y <= max(y0, y1):
            if abs(y1 - y0) < LEAST_SLOPING:
                return -np.inf, np.inf
            x = x0 + (y - y0) / (y1 - y0) * (x1 - x0)
            left, right = min(left, x), max(right, x)
    if left > right:  # the row touches a corner from outside
        return -np.inf, np.inf
    return left - 1, right + 2


@numba.njit(nogil=True, **COMPILED_ONLY)
def _covers(alpha_x, alpha_y, beta_x, beta_y, dx, dy):
    """Whether a triangle covers a pixel at (dx, dy) from its third corner, by the gradients of its barycentric coordinates."""
    alpha, beta = alpha_x * dx + alpha_y * dy, beta_x * dx + beta_y * dy
    return alpha >= -EDGE_TOLERANCE and beta >= -EDGE_TOLERANCE and 1 - alpha - beta >= -EDGE_TOLERANCE


@numba.njit(cache=True, nogil=True)
def _fill(uv, depth, faces, face_id, inverse_depth):
    height, width = face_id.shape
    for f in range(faces.shape[0]):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        if depth[a] <= 0 or depth[b] <= 0 or depth[c] <= 0:
            continue
        ax, ay, bx, by, cx, cy = uv[a, 0], uv[a, 1], uv[b, 0], uv[b, 1], uv[c, 0], uv[c, 1]
        doubled_area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if doubled_area == 0:
            continue
        # Inverse depth is affine over the image of a plane.
        wa, wb, wc = 1 / depth[a], 1 / depth[b], 1 / depth[c]
        alpha_x, alpha_y = (by - cy) / doubled_area, (cx - bx) / doubled_area
        beta_x, beta_y = (cy - ay) / doubled_area, (ax - cx) / doubled_area
        x_low = max(0, int(np.ceil(min(ax, bx, cx) - 1e-6)))
        x_high = min(width - 1, int(np.floor(max(ax, bx, cx) + 1e-6)))
        y_low = max(0, int(np.ceil(min(ay, by, cy) - 1e-6)))
        y_high = min(height - 1, int(np.floor(max(ay, by, cy) + 1e-6)))
        for y in range(y_low, y_high + 1):
            left, right = _row(ax, ay, bx, by, cx, cy, y)
            first, last = max(x_low, int(max(left, x_low))), min(x_high, int(min(right, x_high)))
            while first <= last and not _covers(alpha_x, alpha_y, beta_x, beta_y, first - cx, y - cy):
                first += 1
            while first <= last and not _covers(alpha_x, alpha_y, beta_x, beta_y, last - cx, y - cy):
                last -= 1
            for x in range(first, last + 1):
                alpha = alpha_x * (x - cx) + alpha_y * (y - cy)
                beta = beta_x * (x - cx) + beta_y * (y - cy)
                w = alpha * wa + beta * wb + (1 - alpha - beta) * wc
                if w > inverse_depth[y, x]:
                    inverse_depth[y, x] = w
                    face_id[y, x] = f
