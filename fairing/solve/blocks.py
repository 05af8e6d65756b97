"""Blocks: sets of vertices that take a step at the same time."""

from dataclasses import dataclass

import numpy as np

from fairing.geometry.independent_sets import independent_sets
from fairing.mesh import Mesh


@dataclass(frozen=True, eq=False)
class Block:
    """Vertices that take a step at the same time.

    Attributes:
        vertices: (u,) int, ids.
        faces: (F,) int: the faces around them, ascending.
        corners: (F,) int: the corner of each face that moves, -1 where several may.
        owner: (F,) int: for each face the position in `vertices` of the vertex it counts for.
        coupled: whether the vertices share faces and are solved by one system.
    """

    vertices: np.ndarray
    faces: np.ndarray
    corners: np.ndarray
    owner: np.ndarray
    coupled: bool


def plan_blocks(mesh: Mesh, free: np.ndarray, order: str, face_energy: np.ndarray) -> list[Block]:
    """The blocks of a sweep, in their order.

    Args:
        free: (n,) bool: vertices that may move.
        order: see `ScheduleOptions.order`.
        face_energy: (m,) float: energies that order the blocks of `worst_first`.
    """
    ids = np.flatnonzero(free)
    if len(ids) == 0:
        return []
    if order == "joint":
        faces = np.arange(len(mesh.faces))
        slot = np.full(len(mesh.vertices), -1)
        slot[ids] = np.arange(len(ids))
        corners = slot[mesh.faces]
        # A face counts for its first free vertex; faces without one keep a constant energy and count for any.
        first = np.argmax(corners >= 0, axis=1)
        owner = np.maximum(corners[faces, first], 0)
        return [Block(ids, faces, np.full(len(faces), -1), owner, coupled=True)]
    if order == "sequential":
        return [independent_block(mesh, np.array([v])) for v in ids]
    if order == "worst_first":
        energy = np.array([face_energy[mesh.one_rings[v]].sum() for v in ids])
        return [independent_block(mesh, np.array([v])) for v in ids[np.argsort(-energy, kind="stable")]]
    sets = independent_sets(mesh.faces, ids, len(mesh.vertices))
    return [independent_block(mesh, group) for group in sets]


def independent_block(mesh: Mesh, vertices: np.ndarray) -> Block:
    """A block of vertices (u,) int that share no face, with the faces around them."""
    faces = np.concatenate([mesh.one_rings[v] for v in vertices])
    owner = np.repeat(np.arange(len(vertices)), [len(mesh.one_rings[v]) for v in vertices])
    corners = np.argmax(mesh.faces[faces] == vertices[owner][:, None], axis=1)
    order = np.argsort(faces, kind="stable")
    return Block(vertices, faces[order], corners[order], owner[order], coupled=False)
