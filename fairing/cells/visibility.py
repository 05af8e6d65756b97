"""Which photos a face takes part in, with which samples of its cell, and why not where it does not."""

from dataclasses import dataclass
from enum import IntEnum

import cv2
import numpy as np
from numba import njit

from fairing.camera import Camera
from fairing.geometry.rasterize import rasterize
from fairing.options import VisibilityOptions

# Depth jumps are measured in pixels' worth of depth (depth / focal length). A crease between faces seen at the smallest
# angle looks like a jump of up to 1 / tan(min_angle) of them, so a depth edge is a larger jump.
DEPTH_EDGE_JUMP = 6.0
HIDDEN_DEPTH = 4.0


class Visibility(IntEnum):
    """How a view sees a face."""

    SEEN = 0
    PARTLY_SEEN = 1
    BEHIND_CAMERA = 2
    TURNED_AWAY = 3
    GRAZING = 4
    OUTSIDE_PHOTO = 5
    TOO_SMALL = 6
    HIDDEN = 7  # by other faces, or by the photo's mask
    SURPLUS = 8
    DEGENERATE = 9

    @property
    def takes_part(self) -> bool:
        return self <= Visibility.PARTLY_SEEN


@dataclass(frozen=True, eq=False)
class Footprints:
    """The faces as one camera projects them, (m,) each: area and height in px^2 and px, longest edge in px."""

    area: np.ndarray
    height: np.ndarray
    longest_edge: np.ndarray
    reason: np.ndarray
    """Visibility codes; SEEN where the outline alone speaks for the view."""


def footprints(
    vertices: np.ndarray, faces: np.ndarray, camera: Camera, orientation: int, options: VisibilityOptions, blur: float
) -> Footprints:
    """Judge every face by its outline in a photo; occlusion is judged later, sample by sample.

    Args:
        vertices: (n, 3) float, world units.
        faces: (m, 3) int.
        orientation: 1 if the faces are counter-clockwise seen from outside, -1 if clockwise.
        blur: sigma_smooth of the level, px.
    """
    uv, depth = camera.project(vertices)
    corners, corner_depth = uv[faces], depth[faces]
    with np.errstate(invalid="ignore", over="ignore"):
        edges = corners[:, [1, 2, 0]] - corners
        area = 0.5 * np.abs(edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0])
        longest = np.sqrt((edges**2).sum(-1).max(-1))
        height = 2 * area / np.maximum(longest, 1e-12)
    points = vertices[faces]
    normal = orientation * np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    sight = camera.center - points.mean(1)
    norms = np.linalg.norm(normal, axis=1) * np.linalg.norm(sight, axis=1)
    sine = (normal * sight).sum(1) / np.maximum(norms, 1e-300)
    low, high = corners.min(1), corners.max(1)

    reason = np.full(len(faces), Visibility.SEEN, dtype=np.int8)
    reason[~(height >= options.min_footprint * max(1.0, blur))] = Visibility.TOO_SMALL
    reason[(high < 1).any(1) | (low[:, 0] > camera.width - 2) | (low[:, 1] > camera.height - 2)] = (
        Visibility.OUTSIDE_PHOTO
    )
    reason[sine < np.sin(np.deg2rad(options.min_angle))] = Visibility.GRAZING
    reason[sine <= 0] = Visibility.TURNED_AWAY
    reason[(corner_depth <= 0).any(1)] = Visibility.BEHIND_CAMERA
    reason[norms == 0] = Visibility.DEGENERATE
    return Footprints(area, height, longest, reason)


@dataclass(frozen=True, eq=False)
class DepthMap:
    """What one camera sees of the mesh, at 1 / `reduction` of the photo's resolution.

    Attributes:
        inverse_depth: (h, w) float32, 1 / world units, 0 where there is no face.
        edge_distance: (h, w) float32, photo px to the nearest depth edge or masked pixel.
        focal_length: photo px.
        reduction: photo px per pixel of the maps.
        face_id: (h, w) int32, the face seen, -1 for none.
    """

    inverse_depth: np.ndarray
    edge_distance: np.ndarray
    focal_length: float
    reduction: int
    face_id: np.ndarray


def depth_map(
    vertices: np.ndarray, faces: np.ndarray, camera: Camera, reduction: int = 1, mask: np.ndarray | None = None
) -> DepthMap:
    """Depth and depth edges of the mesh in a photo.

    Args:
        mask: (h, w) bool at the same reduction, True where the photo counts. What is masked is kept away from like a
            depth edge: the blurred photo mixes it in.
    """
    shift = (1 / reduction - 1) / 2
    coarser = np.array([[1 / reduction, 0, shift], [0, 1 / reduction, shift], [0, 0, 1]])
    small = Camera(coarser @ camera.image_from_world, -(-camera.width // reduction), -(-camera.height // reduction))
    face_id, depth = rasterize(vertices, faces, small)
    uv, corner_depth = small.project(vertices)
    focal = float(camera.K[0, 0])
    edges = np.zeros(face_id.shape, dtype=np.uint8)
    inverse = 1 / np.where(corner_depth > 0, corner_depth, np.inf)[faces]
    _mark_depth_edges(uv[faces], inverse, face_id, depth, focal / reduction, edges)
    if mask is not None:
        edges[~mask] = 1
    # Distance to the nearest marked pixel; everything is far away where nothing is marked.
    distance = (
        cv2.distanceTransform(1 - edges, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * np.float32(reduction)
        if edges.any()
        else np.full(edges.shape, 1e6, dtype=np.float32)
    )
    with np.errstate(divide="ignore"):
        return DepthMap((1 / depth).astype(np.float32), distance, focal, reduction, face_id)


@njit(cache=True, nogil=True)
def _plane(uv, inverse_depth, f, x, y):
    """Inverse depth of face f's plane at a pixel."""
    ax, ay, bx, by, cx, cy = uv[f, 0, 0], uv[f, 0, 1], uv[f, 1, 0], uv[f, 1, 1], uv[f, 2, 0], uv[f, 2, 1]
    doubled = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    alpha = ((bx - x) * (cy - y) - (by - y) * (cx - x)) / doubled
    beta = ((cx - x) * (ay - y) - (cy - y) * (ax - x)) / doubled
    return alpha * inverse_depth[f, 0] + beta * inverse_depth[f, 1] + (1 - alpha - beta) * inverse_depth[f, 2]


@njit(cache=True, nogil=True)
def _mark_depth_edges(uv, inverse_depth, face_id, depth, focal, edges):
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
                    d1, d2 = depth[y, x], depth[y2, x2]
                    w1, w2 = _plane(uv, inverse_depth, there, x, y), _plane(uv, inverse_depth, here, x2, y2)
                    m1 = abs(1 / w1 - d1) if w1 > 0 else np.inf
                    m2 = abs(1 / w2 - d2) if w2 > 0 else np.inf
                    is_edge = min(m1, m2) * focal > DEPTH_EDGE_JUMP * min(d1, d2)
                if is_edge:
                    edges[y, x] = 1
                    edges[y2, x2] = 1


@njit(cache=True, nogil=True)
def mask_samples(
    pixels, corners, grids, grid_start, ramp, insets, inverse_depth, edge_distance, face_id, transparent, focal,
    reduction, border, margin, size, masks, starts, seen,
):  # fmt: skip
    """Mark the samples of cells that one photo really shows.

    Args:
        pixels: (n, 3) float64: homogeneous pixels of the vertices (the depth last).
        corners: (c, 3) int64: vertices of the faces to judge.
        grids, insets: (c,): cell grid of each and the border left out, fraction of the face's height.
        grid_start, ramp: the cell grids, see `KernelData`.
        inverse_depth, edge_distance, face_id: see `DepthMap`.
        transparent: (c, 2) int64: faces of the depth map that do not hide the cell; -1 for none.
        border: distance to keep from the photo's border, px.
        margin: distance to keep from depth edges, px.
        size: (width, height) of the photo, px.
        masks: flat uint8, out: the masks one after another.
        starts: (c,) int64: where each begins.
        seen: (c,) int64, out: samples that count.
    """
    for f in range(corners.shape[0]):
        first, last = grid_start[grids[f]], grid_start[grids[f] + 1]
        shrink = 1 - 3 * insets[f]
        a0, a1, a2 = pixels[corners[f, 0]]
        b0, b1, b2 = pixels[corners[f, 1]]
        c0, c1, c2 = pixels[corners[f, 2]]
        count = 0
        for s in range(last - first):
            a, b = insets[f] + shrink * ramp[0, first + s], insets[f] + shrink * ramp[1, first + s]
            c = 1 - a - b
            w = a * a2 + b * b2 + c * c2
            x, y = (a * a0 + b * b0 + c * c0) / w, (a * a1 + b * b1 + c * c1) / w
            is_seen = border <= x <= size[0] - 1 - border and border <= y <= size[1] - 1 - border
            if is_seen:
                ix, iy = int((x + 0.5) / reduction), int((y + 0.5) / reduction)
                front = inverse_depth[iy, ix]
                is_hidden = front > 0 and w - 1 / front > HIDDEN_DEPTH * reduction * w / focal
                if is_hidden:
                    is_hidden = face_id[iy, ix] != transparent[f, 0] and face_id[iy, ix] != transparent[f, 1]
                is_seen = not is_hidden and edge_distance[iy, ix] >= margin
            masks[starts[f] + s] = is_seen
            count += is_seen
        seen[f] = count
