"""Normals of vertices for mesh files: computed anew where vertices have moved, smooth and creased where they were."""

import numpy as np

from fairing.geometry.normals import unit_normals
from fairing.weld import merged_if_equal

_SAME_NORMAL = 1e-3
"""Normals at one position that agree after rounding to this step are copies of one normal: files store rounded ones."""


def smooth_groups(vertices: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """(n,) int: equal for vertices with the same position and the same normal.

    Copies of a vertex along a seam of the texture share one normal; copies along a crease have one on each side.
    """
    positions, groups = merged_if_equal(vertices)
    is_shared = np.bincount(groups, minlength=len(positions))[groups] > 1
    rows = np.column_stack([groups[is_shared], np.rint(normals[is_shared] / _SAME_NORMAL)])
    groups = groups.copy()
    groups[is_shared] = len(positions) + np.unique(rows, axis=0, return_inverse=True)[1].reshape(-1)
    return groups


def at_unit_size(vertices: np.ndarray) -> np.ndarray:
    """Vertices (n, 3) float scaled so that products of three coordinates neither overflow nor vanish."""
    return vertices / (np.abs(vertices).max(initial=0) or 1.0)


def group_normals(vertices: np.ndarray, faces: np.ndarray, groups: np.ndarray, n_groups: int) -> np.ndarray:
    """Unit normals (g, 3) float of groups of corners: of their faces' normals, the mean weighted with the corners' angles.

    Zero for a group without a face that has an area. The angles make the result independent of how flat polygons are cut.
    Source: Thürmer, Wüthrich, Computing Vertex Normals from Polygonal Facets, Journal of Graphics Tools 3, 1998.

    Args:
        vertices: (n, 3) float.
        faces: (m, 3) int.
        groups: (m, 3) int: the group of each corner; negative for none.
    """
    vertices = at_unit_size(vertices)
    corners = vertices[faces]
    along = np.roll(corners, -1, axis=1) - corners
    back = np.roll(corners, 1, axis=1) - corners
    lengths = np.linalg.norm(along, axis=2) * np.linalg.norm(back, axis=2)
    cosines = (along * back).sum(2) / np.maximum(lengths, 1e-300)
    angles = np.arccos(np.clip(cosines, -1, 1))
    weighted = angles[:, :, None] * unit_normals(vertices, faces)[0][:, None]
    is_member = groups >= 0
    sums = np.stack(
        [np.bincount(groups[is_member], weighted[is_member][:, axis], n_groups) for axis in range(3)], axis=1
    )
    length = np.linalg.norm(sums, axis=1)
    return np.where(length[:, None] > 1e-12, sums / np.maximum(length, 1e-300)[:, None], 0.0)


def moved_normals(before: np.ndarray, after: np.ndarray, faces: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Normals (n, 3) float of vertices that moved; a vertex without a face that has an area keeps its normal.

    Args:
        before, after: (n, 3) float, world units.
        faces: (m, 3) int.
        normals: (n, 3) float, of `before`.
    """
    groups = smooth_groups(before, normals)
    found = group_normals(after, faces, groups[faces], int(groups.max(initial=-1)) + 1)[groups]
    return np.where((found != 0).any(axis=1, keepdims=True), found, normals)
