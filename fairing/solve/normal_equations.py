"""From the faces' normal equations to a displacement of the vertices, and whether it may be accepted."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.linalg import splu

from fairing.geometry.normals import face_normals
from fairing.mesh import Mesh
from fairing.options import StepOptions
from fairing.solve.energy import FaceSystem

# Keeps a block with no information invertible; far below every threshold on eigenvalues.
RIDGE = 1e-9


class QuadraticPrior(NamedTuple):
    """(x - a)^T B (x - a) / 2 of every vertex x.

    Attributes:
        blocks: (n, 3, 3) float, B.
        places: (n, 3) float, a, world units.
    """

    blocks: np.ndarray
    places: np.ndarray


@dataclass(frozen=True, eq=False)
class Prior:
    """What holds vertices besides the photos: the sum of some pulls.

    Sliding (directions in which the surface moves in itself) is pulled to the run's start, or to where a hand put the
    vertex. Weakly seen directions are pulled to the sweep's start only: that slows a vertex where it could run off, but
    leaves the minimum where it is (pulled to the run's start, corner A of the cube ended 5 % off).
    """

    pulls: tuple[QuadraticPrior, ...]

    @property
    def blocks(self) -> np.ndarray:
        """(n, 3, 3) float: second derivative."""
        return np.sum([pull.blocks for pull in self.pulls], axis=0)

    def energy(self, vertices: np.ndarray, ids: np.ndarray) -> np.ndarray:
        """(len(ids),) float."""
        total = np.zeros(len(ids))
        for blocks, places in self.pulls:
            offset = vertices[ids] - places[ids]
            total += 0.5 * np.einsum("vi,vij,vj->v", offset, blocks[ids], offset)
        return total

    def gradient(self, vertices: np.ndarray, ids: np.ndarray) -> np.ndarray:
        """(len(ids), 3) float."""
        return sum(
            (np.einsum("vij,vj->vi", blocks[ids], vertices[ids] - places[ids]) for blocks, places in self.pulls),
            np.zeros((len(ids), 3)),
        )


def vertex_systems(mesh: Mesh, system: FaceSystem) -> tuple[np.ndarray, np.ndarray]:
    """Normal matrices (n, 3, 3) and gradients (n, 3) by vertex, summed over the faces of `system`."""
    n = len(mesh.vertices)
    H, g = np.zeros((n, 3, 3)), np.zeros((n, 3))
    corners = mesh.faces[system.faces]
    for j in range(3):
        block = slice(3 * j, 3 * j + 3)
        np.add.at(H, corners[:, j], system.H[:, block, block])
        np.add.at(g, corners[:, j], system.g[:, block])
    return H, g


def undetermined_directions(
    vertices: np.ndarray, mesh: Mesh, H: np.ndarray, usable: np.ndarray, options: StepOptions, strength: float
) -> tuple[np.ndarray, np.ndarray]:
    """Blocks (n, 3, 3) that penalise what photos do not determine: sliding, and weakly seen directions.

    Sliding: the normals of the incident faces have no spread there (inside a plane, along an edge). Weak: a small
    eigenvalue of the normal matrix (little texture, few photos). The penalty is `strength` times the largest eigenvalue.

    Args:
        H: (n, 3, 3) float: normal matrices.
        usable: (m,) bool: faces that take part.
        strength: relative.
    """
    normals = face_normals(vertices, mesh.faces)
    area = np.linalg.norm(normals, axis=1, keepdims=True)
    unit = normals / np.maximum(area, 1e-300)
    spread = np.zeros((len(vertices), 3, 3))
    total = np.zeros(len(vertices))
    weight = area[:, 0] * usable
    for j in range(3):
        np.add.at(spread, mesh.faces[:, j], weight[:, None, None] * unit[:, :, None] * unit[:, None, :])
        np.add.at(total, mesh.faces[:, j], weight)
    spread /= np.maximum(total, 1e-300)[:, None, None]
    values, vectors = np.linalg.eigh(H)
    largest = np.maximum(values[:, 2], 0)
    weak = values < options.prior_threshold * largest[:, None]
    weak_blocks = np.einsum("vik,vk,vjk->vij", vectors, weak.astype(float), vectors)
    values, vectors = np.linalg.eigh(spread)
    flat = values < options.normal_spread
    sliding = np.einsum("vik,vk,vjk->vij", vectors, flat.astype(float), vectors)
    penalty = strength * largest[:, None, None]
    return penalty * sliding, penalty * weak_blocks


def solve_vertices(H: np.ndarray, g: np.ndarray, damping: np.ndarray) -> np.ndarray:
    """Steps (u, 3) of vertices that do not share faces: -(H + damping diag H)^-1 g, one by one.

    Directions without any information are left alone.
    """
    values, vectors = np.linalg.eigh(H)
    largest = np.maximum(values[:, 2:], 0)
    inverse = np.where(values > RIDGE * largest, 1, 0) / np.where(
        values > RIDGE * largest, values + damping[:, None] * largest, 1
    )
    return -np.einsum("vik,vk,vjk,vj->vi", vectors, inverse, vectors, g)


def solve_jointly(
    mesh: Mesh, system: FaceSystem, blocks: np.ndarray, gradient: np.ndarray, free: np.ndarray, damping: float
) -> np.ndarray:
    """Steps (n, 3) of all free vertices from one sparse system.

    Args:
        blocks: (n, 3, 3) float: priors to add on the diagonal.
        gradient: (n, 3) float: gradient including the priors'.
        free: (n,) bool.
        damping: Levenberg-Marquardt, relative to the diagonal blocks' largest eigenvalue.
    """
    n = len(mesh.vertices)
    slot = np.full(n, -1, dtype=np.int32)  # as narrow as the sparse matrix's own indices: rows and columns are long
    slot[free] = np.arange(free.sum())
    corners = slot[mesh.faces[system.faces]]
    index = (3 * corners[:, :, None] + np.arange(3, dtype=np.int32)).reshape(-1, 9)
    index[np.repeat(corners < 0, 3, axis=1)] = -1
    rows, columns = np.repeat(index, 9, axis=1).reshape(-1), np.tile(index, (1, 9)).reshape(-1)
    keep = (rows >= 0) & (columns >= 0)
    H_vertex = blocks.copy()
    diagonal, _ = vertex_systems(mesh, system)
    strength = np.maximum(np.linalg.eigvalsh(diagonal + blocks)[:, 2], 0)
    typical = np.median(strength[free & (strength > 0)]) if (free & (strength > 0)).any() else 1.0
    H_vertex += ((damping * strength + 1e-6 * strength + RIDGE * typical)[:, None, None]) * np.eye(3)
    own = 3 * np.arange(free.sum(), dtype=np.int32)[:, None] + np.arange(3, dtype=np.int32)
    own_rows = np.repeat(own, 3, axis=1).reshape(-1)
    own_columns = np.tile(own, (1, 3)).reshape(-1)
    matrix = coo_array(
        (
            np.concatenate([system.H.reshape(-1)[keep], H_vertex[free].reshape(-1)]),
            (np.concatenate([rows[keep], own_rows]), np.concatenate([columns[keep], own_columns])),
        ),
        shape=(3 * int(free.sum()),) * 2,
    ).tocsc()
    solution = splu(matrix, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}).solve(
        -gradient[free].reshape(-1)
    )
    step = np.zeros((n, 3))
    step[free] = solution.reshape(-1, 3)
    return step
