"""Normal equations by vertex, quadratic priors, and the solution of damped Gauss-Newton steps."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.linalg import splu

from fairing.geometry.normals import unit_normals
from fairing.mesh import Mesh
from fairing.options import StepOptions
from fairing.solve.energy import FaceSystem

# Keeps a matrix without information invertible; far below every threshold on eigenvalues.
RIDGE = 1e-9


class QuadraticPrior(NamedTuple):
    """(x - a)^T B (x - a) / 2 of every vertex x.

    Attributes:
        hessians: (n, 3, 3) float, B, energy / world unit^2.
        targets: (n, 3) float, a, world units.
    """

    hessians: np.ndarray
    targets: np.ndarray


@dataclass(frozen=True, eq=False)
class Prior:
    """The sum of several quadratic priors.

    Tangential directions (in which the surface moves within itself) have their target at the origin of the vertex: the start
    of the run, or its position after a manual edit. Weakly seen directions have theirs at the beginning of the sweep, which
    slows a diverging vertex without moving the minimum, and after a fit to points so has a slight prior of all directions,
    which stops vertices without texture around them; a prior to the start replaces both. (ledger: prior of weak
    directions, inertia)
    """

    terms: tuple[QuadraticPrior, ...]

    @property
    def hessians(self) -> np.ndarray:
        """(n, 3, 3) float: second derivatives, energy / world unit^2."""
        return np.sum([term.hessians for term in self.terms], axis=0)

    def energy(self, vertices: np.ndarray, ids: np.ndarray) -> np.ndarray:
        """(u,) float: energy of vertices `ids` (u,) int at positions `vertices` (n, 3) float, world units."""
        total = np.zeros(len(ids))
        for hessians, targets in self.terms:
            offset = vertices[ids] - targets[ids]
            total += 0.5 * np.einsum("vi,vij,vj->v", offset, hessians[ids], offset)
        return total

    def gradient(self, vertices: np.ndarray, ids: np.ndarray) -> np.ndarray:
        """(u, 3) float: gradient for the same arguments, energy / world unit."""
        return sum(
            (np.einsum("vij,vj->vi", hessians[ids], vertices[ids] - targets[ids]) for hessians, targets in self.terms),
            np.zeros((len(ids), 3)),
        )


def vertex_systems(mesh: Mesh, system: FaceSystem) -> tuple[np.ndarray, np.ndarray]:
    """Normal matrices (n, 3, 3) float and gradients (n, 3) float by vertex, summed over the faces of `system`.

    Units: energy / world unit^2 and energy / world unit.
    """
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
    """Hessians (n, 3, 3) float of penalties on tangential and on weakly seen directions, energy / world unit^2.

    Tangential: the normals of the incident faces have no spread along it (within a plane, along an edge). Weakly seen: its
    eigenvalue of the normal matrix is small (little texture, few photos).

    Args:
        vertices: (n, 3) float: positions, world units.
        H: (n, 3, 3) float: normal matrices.
        usable: (m,) bool: faces that take part.
        strength: of the penalties, relative to the largest eigenvalue of each normal matrix.
    """
    normals, area = unit_normals(vertices, mesh.faces)
    spread = np.zeros((len(vertices), 3, 3))
    total = np.zeros(len(vertices))
    weight = area * usable
    for j in range(3):
        np.add.at(spread, mesh.faces[:, j], weight[:, None, None] * normals[:, :, None] * normals[:, None, :])
        np.add.at(total, mesh.faces[:, j], weight)
    spread /= np.maximum(total, 1e-300)[:, None, None]
    values, vectors = np.linalg.eigh(H)
    largest = np.maximum(values[:, 2], 0)
    weak = values < options.prior_threshold * largest[:, None]
    weak_directions = np.einsum("vik,vk,vjk->vij", vectors, weak.astype(float), vectors)
    values, vectors = np.linalg.eigh(spread)
    flat = values < options.normal_spread
    tangential = np.einsum("vik,vk,vjk->vij", vectors, flat.astype(float), vectors)
    penalty = strength * largest[:, None, None]
    return penalty * tangential, penalty * weak_directions


def solve_vertices(H: np.ndarray, g: np.ndarray, damping: np.ndarray) -> np.ndarray:
    """Steps (u, 3) float of vertices that share no face: -(H + damping lambda I)^-1 g, lambda the largest eigenvalue of H.

    The step is zero in directions without information. Damping by diag H (Marquardt) would depend on the world's axes.

    Args:
        H: (u, 3, 3) float: normal matrices, energy / world unit^2.
        g: (u, 3) float: gradients, energy / world unit.
        damping: (u,) float, relative.
    """
    values, vectors = np.linalg.eigh(H)
    largest = np.maximum(values[:, 2:], 0)
    inverse = np.where(values > RIDGE * largest, 1, 0) / np.where(
        values > RIDGE * largest, values + damping[:, None] * largest, 1
    )
    return -np.einsum("vik,vk,vjk,vj->vi", vectors, inverse, vectors, g)


def solve_jointly(
    mesh: Mesh, system: FaceSystem, hessians: np.ndarray, gradient: np.ndarray, free: np.ndarray, damping: float
) -> np.ndarray:
    """Steps (n, 3) float of all free vertices from one sparse system, world units; zero for the others.

    Args:
        system: normal equations of the faces.
        hessians: (n, 3, 3) float: of the priors.
        gradient: (n, 3) float: of energy and priors.
        free: (n,) bool.
        damping: multiple of the identity that is added to the 3 x 3 block of each vertex, relative to the largest eigenvalue
            of that block.
    """
    n = len(mesh.vertices)
    slot = np.full(n, -1, dtype=np.int32)  # as narrow as the sparse matrix's own indices: rows and columns are long
    slot[free] = np.arange(free.sum())
    corners = slot[mesh.faces[system.faces]]
    index = (3 * corners[:, :, None] + np.arange(3, dtype=np.int32)).reshape(-1, 9)
    index[np.repeat(corners < 0, 3, axis=1)] = -1
    rows, columns = np.repeat(index, 9, axis=1).reshape(-1), np.tile(index, (1, 9)).reshape(-1)
    keep = (rows >= 0) & (columns >= 0)
    H_vertex = hessians.copy()
    diagonal, _ = vertex_systems(mesh, system)
    strength = np.maximum(np.linalg.eigvalsh(diagonal + hessians)[:, 2], 0)
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


def faded(hessians: np.ndarray, H: np.ndarray) -> np.ndarray:
    """Hessians B (n, 3, 3) float of a prior, faded where normal matrices H (n, 3, 3) float are larger: B (B + H)^-1 B.

    In a direction in which B has the share s of the sum, s B remains.
    """
    total = hessians + H
    least = 1e-9 * np.trace(total, axis1=1, axis2=2) + 1e-300  # both may be singular in the same direction
    result = hessians @ np.linalg.solve(total + least[:, None, None] * np.eye(3), hessians)
    return 0.5 * (result + result.transpose(0, 2, 1))
