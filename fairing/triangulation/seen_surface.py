"""The part of a closed surface that photos show: the rest is a guess about what no photo sees."""

from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fairing.geometry.normals import face_normals
from fairing.geometry.rasterize import HIDDEN_DEPTH, rasterize
from fairing.scene import View
from fairing.triangulation.cut_surface import split_at_vertices

LONG = 12.0
"""Faces with an edge longer than this times the median of the faces' longest edges are left out."""
LEAST_ISLAND = 0.02
"""Components with less than this fraction of the faces are left out."""
MAP_WIDTH = 640
"""Width of the depth maps in which visibility is judged, px."""
PLACES = np.array([[1, 1, 1], [13, 1, 1], [1, 13, 1], [1, 1, 13]]) / np.array([[3.0], [15.0], [15.0], [15.0]])
"""Barycentric coordinates of the places of a face that must be visible: its centre and a fifth of the way in from its corners."""


class Fate(IntEnum):
    """What becomes of a face of the closed surface."""

    KEPT = 0
    UNSEEN = 1
    LONG = 2
    SMALL_COMPONENT = 3

    @property
    def text(self) -> str:
        """The reason, for users."""
        return ("kept", "not seen whole by any photo", "too long", "in a small component")[self]


class SeenSurface(NamedTuple):
    """The part of a closed surface that is kept.

    Attributes:
        faces: (k, 3) int, as ids of their own, an oriented two-manifold with border.
        former: (n,) int: the former vertex of each id.
        fates: (m,) int8: `Fate` of each face of the closed surface; `faces` are those that are kept, in the same order.
    """

    faces: np.ndarray
    former: np.ndarray
    fates: np.ndarray


def seen_surface(vertices: np.ndarray, faces: np.ndarray, views: Sequence[View], gap: float) -> SeenSurface:
    """Faces that a photo sees whole, without long ones and small components.

    Args:
        vertices: (n, 3) float, world units.
        faces: (m, 3) int, counter-clockwise seen from outside.
        gap: area, world units squared: connected unseen faces of less area stay; else single faces of a rough surface that
            happen to be hidden would leave holes.
    """
    fates = np.full(len(faces), Fate.KEPT, dtype=np.int8)
    if len(faces) == 0:
        return SeenSurface(faces, np.zeros(0, dtype=np.int64), fates)
    sides = np.linalg.norm(vertices[faces] - vertices[faces[:, [1, 2, 0]]], axis=2).max(axis=1)
    area = np.linalg.norm(face_normals(vertices, faces), axis=1) / 2
    unseen = np.flatnonzero(~_seen_whole(vertices, faces, views))
    part = _parts(split_at_vertices(faces[unseen])[0])
    unseen = unseen[np.bincount(part, area[unseen])[part] >= gap]
    fates[sides > LONG * np.median(sides)] = Fate.LONG
    fates[unseen] = Fate.UNSEEN
    kept, former = split_at_vertices(faces[fates == Fate.KEPT])
    part = _parts(kept)
    is_large = np.bincount(part)[part] >= LEAST_ISLAND * len(kept)
    fates[np.flatnonzero(fates == Fate.KEPT)[~is_large]] = Fate.SMALL_COMPONENT
    used, corners = np.unique(kept[is_large], return_inverse=True)
    return SeenSurface(corners.reshape(-1, 3), former[used], fates)


def _parts(faces: np.ndarray) -> np.ndarray:
    """(m,) int: number of the connected component of each face."""
    n = int(faces.max(initial=-1)) + 1
    ends = faces[:, [0, 1, 1, 2]].reshape(-1, 2)
    graph = coo_array((np.ones(len(ends), dtype=bool), (ends[:, 0], ends[:, 1])), shape=(n, n))
    return connected_components(graph, directed=False)[1][faces[:, 0]]


def _seen_whole(vertices: np.ndarray, faces: np.ndarray, views: Sequence[View]) -> np.ndarray:
    """(m,) bool: faces that some photo shows from outside, with no other face before them."""
    corners = vertices[faces]
    normals = face_normals(vertices, faces)
    places = np.einsum("kc,mcx->mkx", PLACES, corners).reshape(-1, 3)
    seen = np.zeros(len(faces), dtype=bool)
    for view in views:
        shrink = min(1.0, MAP_WIDTH / view.camera.width)
        camera = view.camera.resized(
            *(max(1, round(shrink * size)) for size in (view.camera.width, view.camera.height))
        )
        nearest = rasterize(vertices, faces, camera)[1]
        uv, depth = camera.project(places)
        with np.errstate(invalid="ignore"):
            column, row = np.nan_to_num(np.rint(uv), nan=-1, posinf=-1, neginf=-1).clip(-1, 2**30).astype(np.int64).T
        shown = (depth > 0) & (column >= 0) & (row >= 0) & (column < camera.width) & (row < camera.height)
        column, row = np.where(shown, column, 0), np.where(shown, row, 0)
        shown &= depth <= nearest[row, column] * (1 + HIDDEN_DEPTH / camera.K[0, 0])
        faces_camera = (normals * (camera.center - corners[:, 0])).sum(axis=1) > 0
        seen |= faces_camera & shown.reshape(-1, len(PLACES)).all(axis=1)
    return seen
