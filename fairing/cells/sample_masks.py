"""Sample masks: which samples of a face one photo really shows, by occlusion and the photo's borders and mask."""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from fairing.camera import Camera
from fairing.cells.depth_map import DepthMap, depth_map
from fairing.cells.layout import CellLayout
from fairing.cells.scale_space import ScaleSpace
from fairing.cells.visibility import Visibility
from fairing.geometry.rasterize import HIDDEN_DEPTH
from fairing.options import VisibilityOptions
from fairing.util.compiled_only import COMPILED_ONLY

# By so much more than rounding errors a face is inside the photo, px, and in front of the depth map, as a part of its depth.
CERTAIN = 1e-6


@dataclass(frozen=True, eq=False)
class Occluders:
    """An occluding surface that differs from the mesh of the cells, used to judge candidate faces.

    Attributes:
        depth_maps: one per photo.
        transparent: (m, 2) int: for each face of the cells, the faces of that surface that it would replace and that
            therefore do not hide it; -1 for none.
    """

    depth_maps: Sequence[DepthMap]
    transparent: np.ndarray


class ViewMasks(NamedTuple):
    """The partly seen faces of one photo.

    Attributes:
        faces: (c,) int: face ids.
        masks: flat uint8: the samples' masks, face after face; 1 where the photo shows the sample.
    """

    faces: np.ndarray
    masks: np.ndarray


def mask_views(
    vertices: np.ndarray,
    faces: np.ndarray,
    cameras: Sequence[Camera],
    photos: ScaleSpace,
    layout: CellLayout,
    options: VisibilityOptions,
    blur: float,
    reasons: np.ndarray,
    occluders: Occluders | None,
    pool: Executor,
    on_view: Callable[[], None],
) -> list[ViewMasks]:
    """Judge occlusion sample by sample in all photos, several photos at a time.

    Args:
        vertices: (n, 3) float, world units.
        faces: (m, 3) int.
        cameras: V cameras.
        photos: provides the photos' masks.
        blur: sigma_smooth of the level, px; samples keep a distance from depth edges that grows with it.
        reasons: (m, V) int8, `Visibility`: faces that are SEEN are judged, and become PARTLY_SEEN or HIDDEN in place.
        occluders: what hides the cells; None: the mesh itself.
        on_view: called before each photo is judged, from the pool's threads.

    Returns:
        The masks of each photo's partly seen faces.
    """
    is_candidate = reasons == Visibility.SEEN
    samples = layout.samples
    margin = options.edge_margin * blur + 1.0
    most = int(samples.max(initial=0))
    P = np.stack([camera.image_from_world for camera in cameras])

    def mask_view(v: int) -> ViewMasks:
        chosen = np.flatnonzero(is_candidate[:, v])
        on_view()
        if len(chosen) == 0:
            return ViewMasks(chosen, np.zeros(0, dtype=np.uint8))
        if occluders is None:
            depths = depth_map(vertices, faces, cameras[v], options.reduction, photos.mask(v, options.reduction))
            transparent = np.full((len(chosen), 2), -1, dtype=np.int64)
        else:
            depths, transparent = occluders.depth_maps[v], occluders.transparent[chosen]
        starts = np.concatenate([[0], np.cumsum(samples[chosen])])
        masks, seen = np.empty(starts[-1], dtype=np.uint8), np.empty(len(chosen), dtype=np.int64)
        row, column = np.empty((2, most), dtype=np.int32)
        _mask_samples(
            vertices @ P[v, :, :3].T + P[v, :, 3], faces[chosen], layout.face_grid[chosen], layout.grid_start, layout.ramp,
            layout.inset[chosen], depths.inverse_depth, depths.near_edges(margin), depths.face_id, transparent,
            HIDDEN_DEPTH * depths.reduction, depths.focal_length, depths.reduction, 1.0 + blur,
            (cameras[v].width, cameras[v].height), masks, starts[:-1], seen,
            np.empty(most), row, column, np.empty(most, dtype=bool),
        )  # fmt: skip
        is_partial = seen < samples[chosen]
        reasons[chosen[is_partial], v] = Visibility.PARTLY_SEEN
        is_hidden = seen < options.min_samples * samples[chosen]
        reasons[chosen[is_hidden], v] = Visibility.HIDDEN
        kept = is_partial & ~is_hidden
        return ViewMasks(chosen[kept], masks[np.repeat(kept, samples[chosen])])

    return list(pool.map(mask_view, range(len(cameras))))


@njit(cache=True, nogil=True, error_model="numpy")
def _mask_samples(
    pixels, corners, grids, grid_start, ramp, insets, inverse_depth, near_edges, face_id, transparent, hidden_depth,
    focal, reduction, border, size, masks, starts, seen, depth, row, column, is_inside,
):  # fmt: skip
    """Mark the samples of cells that one photo really shows.

    Args:
        pixels: (n, 3) float64: homogeneous pixels of the vertices (the depth last).
        corners: (c, 3) int64: vertices of the faces to judge.
        grids, insets: (c,): cell grid of each and the border left out, fraction of the face's height.
        grid_start, ramp: the cell grids, see `CellLayout`.
        inverse_depth, face_id: see `DepthMap`.
        near_edges: (h, w) uint8: 1 where samples are too near to a depth edge.
        transparent: (c, 2) int64: faces of the depth map that do not hide the cell; -1 for none.
        hidden_depth: photo pixels' worth of depth by which a surface must lie in front of a sample to hide it.
        border: distance to keep from the photo's border, px.
        size: (width, height) of the photo, px.
        masks: flat uint8, out: the masks one after another; that of a cell seen as a whole is left as it is.
        starts: (c,) int64: where each begins.
        seen: (c,) int64, out: number of samples that the photo shows.
        depth, row, column, is_inside: (s,) scratch for the samples of a cell: allocated here they would double the compilation.
    """
    nearer, to_map = 1 - hidden_depth / focal, 1 / reduction
    right, bottom = size[0] - 1 - border, size[1] - 1 - border
    for f in range(corners.shape[0]):
        first, last = grid_start[grids[f]], grid_start[grids[f] + 1]
        shrink = 1 - 3 * insets[f]
        a0, a1, a2 = pixels[corners[f, 0]]
        b0, b1, b2 = pixels[corners[f, 1]]
        c0, c1, c2 = pixels[corners[f, 2]]
        if _is_clear(
            a0 / a2, a1 / a2, 1 / a2, b0 / b2, b1 / b2, 1 / b2, c0 / c2, c1 / c2, 1 / c2,
            inverse_depth, near_edges, nearer, to_map, border, size,
        ):  # fmt: skip
            seen[f] = last - first
            continue
        for s in range(last - first):  # one division and no branch, so that the loop vectorises (ledger: sample masks)
            a, b = insets[f] + shrink * ramp[0, first + s], insets[f] + shrink * ramp[1, first + s]
            c = 1 - a - b
            depth[s] = a * a2 + b * b2 + c * c2
            inverse = 1 / depth[s]
            x, y = (a * a0 + b * b0 + c * c0) * inverse, (a * a1 + b * b1 + c * c1) * inverse
            inside = (border <= x) & (x <= right) & (border <= y) & (y <= bottom)
            is_inside[s] = inside
            x, y = x if inside else 0.0, y if inside else 0.0
            column[s], row[s] = np.int32((x + 0.5) * to_map), np.int32((y + 0.5) * to_map)
        count = 0
        for s in range(last - first):
            ix, iy = column[s], row[s]
            is_hidden = inverse_depth[iy, ix] * depth[s] * nearer > 1
            if is_hidden:
                is_hidden = face_id[iy, ix] != transparent[f, 0] and face_id[iy, ix] != transparent[f, 1]
            is_seen = is_inside[s] & (not is_hidden) & (near_edges[iy, ix] == 0)
            masks[starts[f] + s] = is_seen
            count += is_seen
        seen[f] = count


@njit(nogil=True, error_model="numpy", **COMPILED_ONLY)
def _is_clear(
    ax, ay, a_inverse, bx, by, b_inverse, cx, cy, c_inverse, inverse_depth, near_edges, nearer, to_map, border, size
):
    """Whether the photo shows a face as a whole: no pixel of the depth map that it touches excludes a sample.

    Most faces are clear, and have several samples per pixel of the map. Only what is certain counts as clear, so that the
    result is that of the samples. (ledger: sample masks)

    Args:
        ax, ay, a_inverse: a corner in the photo, px, and its inverse depth; likewise b and c.
        nearer, to_map: see `_mask_samples`.
    """
    least = border + CERTAIN
    if min(ax, bx, cx) < least or max(ax, bx, cx) > size[0] - 1 - least:
        return False
    if min(ay, by, cy) < least or max(ay, by, cy) > size[1] - 1 - least:
        return False
    ax, ay, bx, by = (ax + 0.5) * to_map, (ay + 0.5) * to_map, (bx + 0.5) * to_map, (by + 0.5) * to_map
    cx, cy = (cx + 0.5) * to_map, (cy + 0.5) * to_map
    # Inverse depth is affine over the image of a plane.
    doubled = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    if doubled == 0:
        return False
    along_x = ((b_inverse - a_inverse) * (cy - ay) - (c_inverse - a_inverse) * (by - ay)) / doubled
    along_y = ((c_inverse - a_inverse) * (bx - ax) - (b_inverse - a_inverse) * (cx - ax)) / doubled
    least_in_pixel = min(along_x, 0.0) + min(along_y, 0.0)
    for y in range(int(min(ay, by, cy) - CERTAIN), int(max(ay, by, cy) + CERTAIN) + 1):
        left, right = np.inf, -np.inf
        for x0, y0, x1, y1 in ((ax, ay, bx, by), (bx, by, cx, cy), (cx, cy, ax, ay)):
            low, high = max(min(y0, y1), y - CERTAIN), min(max(y0, y1), y + 1 + CERTAIN)
            if low > high:
                continue
            slope = (x1 - x0) / (y1 - y0) if y1 != y0 else 0.0
            for end in (low, high):
                x = x0 + (end - y0) * slope
                left, right = min(left, x), max(right, x)
            if y1 == y0:
                left, right = min(left, x1), max(right, x1)
        for x in range(int(left - CERTAIN), int(right + CERTAIN) + 1):
            inverse = a_inverse + (x - ax) * along_x + (y - ay) * along_y + least_in_pixel
            if near_edges[y, x] or inverse_depth[y, x] * nearer * (1 + CERTAIN) > inverse:
                return False
    return True
