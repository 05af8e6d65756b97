"""Creases of a mesh: its edges between two faces that meet at an angle."""

from typing import NamedTuple

import numpy as np
import trimesh

from fairing.geometry.normals import unit_normals

MIN_ANGLE = 15.0  # degrees between the normals


class Creases(NamedTuple):
    """Attributes:
    ends: (e, 2) int: vertex ids.
    faces: (e, 2) int: ids of the two faces.
    is_concave: (e,) bool: the faces enclose less than 180 degrees on the side that the photos show.
    """

    ends: np.ndarray
    faces: np.ndarray
    is_concave: np.ndarray


def find_creases(vertices: np.ndarray, faces: np.ndarray, orientation: int) -> Creases:
    """The edges that exactly two faces share, with more than `MIN_ANGLE` between the normals, sorted by their ends.

    Args:
        vertices: (n, 3) float, world units.
        faces: (m, 3) int.
        orientation: 1 if the photos show the counter-clockwise side of the faces, -1 otherwise.
    """
    both, ends = trimesh.graph.face_adjacency(faces, return_edges=True)
    order = np.lexsort(ends.T[::-1])
    both, ends = both[order], ends[order]
    normals = orientation * unit_normals(vertices, faces)[0]
    is_crease = (normals[both[:, 0]] * normals[both[:, 1]]).sum(axis=1) < np.cos(np.radians(MIN_ANGLE))
    ends, both = ends[is_crease], both[is_crease]
    apex = faces[both[:, 1]].sum(axis=1) - ends.sum(axis=1)  # the corner of the second face that is not on the edge
    height = ((vertices[apex] - vertices[ends[:, 0]]) * normals[both[:, 0]]).sum(axis=1)
    return Creases(ends, both, height > 0)
