"""Depth maps: inverse depth, visible faces and depth edges in one photo."""

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numba import njit

from fairing.camera import Camera, resizing
from fairing.geometry.rasterize import rasterize_inverse
from fairing.util.compiled_only import COMPILED_ONLY

# Depth jumps are measured in pixels' worth of depth (depth / focal length). A crease between faces seen at the smallest
# allowed angle looks like a jump of up to 1 / tan(min_angle) of them, so a depth edge is a larger jump.
DEPTH_EDGE_JUMP = 6.0


@dataclass(frozen=True, eq=False)
class DepthMap:
    """What one camera sees of the mesh, at 1 / `reduction` of the photo's resolution.

    Attributes:
        inverse_depth: (h, w) float32, 1 / world units, 0 where there is no face.
        edges: (h, w) uint8, 1 at depth edges and masked pixels.
        focal_length: photo px.
        reduction: photo px per pixel of the maps.
        face_id: (h, w) int32, the visible face, -1 for none.
    """

    inverse_depth: np.ndarray
    edges: np.ndarray
    focal_length: float
    reduction: int
    face_id: np.ndarray

    def near_edges(self, distance: float) -> np.ndarray:
        """(h, w) uint8: 1 at pixels nearer than a distance, photo px, to a depth edge or a masked pixel."""
        disc = _disc(distance / self.reduction)
        return self.edges if disc.size == 1 else cv2.dilate(self.edges, disc)


def depth_map(
    vertices: np.ndarray, faces: np.ndarray, camera: Camera, reduction: int = 1, mask: np.ndarray | None = None
) -> DepthMap:
    """Depth and depth edges of the mesh in a photo.

    Args:
        vertices: (n, 3) float, world units.
        faces: (m, 3) int.
        reduction: photo px per pixel of the maps.
        mask: (h, w) bool at the same reduction, True where the photo is used. Masked pixels count as depth edges, because
            the blurred photo mixes them into their neighbours.
    """
    small = _reduced(camera, reduction)
    face_id, inverse_depth = rasterize_inverse(vertices, faces, small)
    uv, corner_depth = small.project(vertices)
    focal = float(camera.K[0, 0])
    edges = np.zeros(face_id.shape, dtype=np.uint8)
    at_corners = 1 / np.where(corner_depth > 0, corner_depth, np.inf)[faces]
    _mark_depth_edges(uv[faces], at_corners, face_id, inverse_depth, focal / reduction, edges)
    if mask is not None:
        edges[~mask] = 1
    return DepthMap(inverse_depth.astype(np.float32), edges, focal, reduction, face_id)


@lru_cache(maxsize=4096)
def _reduced(camera: Camera, reduction: int) -> Camera:
    """The camera of a photo at 1 / `reduction` of its resolution."""
    coarser = resizing((reduction, reduction), (1, 1))
    return Camera(coarser @ camera.image_from_world, -(-camera.width // reduction), -(-camera.height // reduction))


@lru_cache(maxsize=64)
def _disc(radius: float) -> np.ndarray:
    """(2 r + 1, 2 r + 1) uint8: 1 at the pixels nearer than `radius`, px, to the middle one."""
    reach = max(0, int(np.ceil(radius)) - 1)
    along = np.arange(-reach, reach + 1)
    return (np.hypot(along[:, None], along) < radius).astype(np.uint8)


@njit(nogil=True, **COMPILED_ONLY)
def _plane(uv, at_corners, f, x, y):
    """Inverse depth of face f's plane at a pixel."""
    ax, ay, bx, by, cx, cy = uv[f, 0, 0], uv[f, 0, 1], uv[f, 1, 0], uv[f, 1, 1], uv[f, 2, 0], uv[f, 2, 1]
    doubled = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    alpha = ((bx - x) * (cy - y) - (by - y) * (cx - x)) / doubled
    beta = ((cx - x) * (ay - y) - (cy - y) * (ax - x)) / doubled
    return alpha * at_corners[f, 0] + beta * at_corners[f, 1] + (1 - alpha - beta) * at_corners[f, 2]


@njit(cache=True, nogil=True)
def _mark_depth_edges(uv, at_corners, face_id, inverse_depth, focal, edges):
    """Mark both pixels of every neighbouring pair that a depth edge separates, in `edges` (h, w) uint8.

    Args:
        at_corners: (m, 3) float64: inverse depths of the faces' corners.
    """
    height, width = face_id.shape
    for y in range(height):
        for x in range(width):
            here = face_id[y, x]
            for step in range(2):
                x2, y2 = (x + 1, y) if step == 0 else (x, y + 1)
                if x2 >= width or y2 >= height:
                    continue
                there = face_id[y2, x2]
                if here == there:
                    continue
                is_edge = here < 0 or there < 0
                if not is_edge:
                    d1, d2 = 1 / inverse_depth[y, x], 1 / inverse_depth[y2, x2]
                    w1, w2 = _plane(uv, at_corners, there, x, y), _plane(uv, at_corners, here, x2, y2)
                    m1 = abs(1 / w1 - d1) if w1 > 0 else np.inf
                    m2 = abs(1 / w2 - d2) if w2 > 0 else np.inf
                    is_edge = min(m1, m2) * focal > DEPTH_EDGE_JUMP * min(d1, d2)
                if is_edge:
                    edges[y, x] = 1
                    edges[y2, x2] = 1
