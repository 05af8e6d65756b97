"""Normal equations by vertex, quadratic priors, and the solution of damped Gauss-Newton steps."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.linalg import splu

from fairing.mesh import Mesh
from fairing.solve.energy import FaceSystem

# Keeps a matrix without information invertible; far below every threshold on eigenvalues.
RIDGE = 1e-9


class QuadraticPrior(NamedTuple):
    """(x - a)^T B (x - a) / 2 of every vertex x.

    Attributes:
        hessians: (n, 3, 3) float, B, energy / world unit^2.
        targets: (n, 3) float, a, world units.
        name: of the term, a key of `fairing.terms.names.TERMS`.
    """

    hessians: np.ndarray
    targets: np.ndarray
    name: str

    def energy(self, vertices: np.ndarray, ids: np.ndarray) -> np.ndarray:
        """(u,) float: energy of vertices `ids` (u,) int at positions `vertices` (n, 3) float, world units."""
        offset = vertices[ids] - self.targets[ids]
        return 0.5 * np.einsum("vi,vij,vj->v", offset, self.hessians[ids], offset)

    def gradient(self, vertices: np.ndarray, ids: np.ndarray) -> np.ndarray:
        """(u, 3) float: gradient for the same arguments, energy / world unit."""
        return np.einsum("vij,vj->vi", self.hessians[ids], vertices[ids] - self.targets[ids])


@dataclass(frozen=True, eq=False)
class Prior:
    """The sum of several quadratic priors."""

    terms: tuple[QuadraticPrior, ...]

    @property
    def hessians(self) -> np.ndarray:
        """(n, 3, 3) float: second derivatives, energy / world unit^2."""
        return np.sum([term.hessians for term in self.terms], axis=0)

    def energy(self, vertices: np.ndarray, ids: np.ndarray) -> np.ndarray:
        """(u,) float: energy of vertices `ids` (u,) int at positions `vertices` (n, 3) float, world units."""
        return sum((term.energy(vertices, ids) for term in self.terms), np.zeros(len(ids)))

    def gradient(self, vertices: np.ndarray, ids: np.ndarray) -> np.ndarray:
        """(u, 3) float: gradient for the same arguments, energy / world unit."""
        return sum((term.gradient(vertices, ids) for term in self.terms), np.zeros((len(ids), 3)))


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


def solve_vertices(H: np.ndarray, g: np.ndarray, damping: np.ndarray) -> np.ndarray:
    """Steps of vertices, each by its own system: -(H + damping lambda I)^-1 g, lambda the largest eigenvalue of H.

    The step is zero in directions without information. Damping by diag H (Marquardt) would depend on the world's axes.

    Args:
        H: (u, 3, 3) float: normal matrices, energy / world unit^2.
        g: (u, 3) or (u, 3, r) float: one or r gradients of each vertex, energy / world unit.
        damping: (u,) float, relative.

    Returns:
        (u, 3) or (u, 3, r) float: the step of each gradient, world units.
    """
    values, vectors = np.linalg.eigh(H)
    largest = np.maximum(values[:, 2:], 0)
    inverse = np.where(values > RIDGE * largest, 1, 0) / np.where(
        values > RIDGE * largest, values + damping[:, None] * largest, 1
    )
    return -np.einsum("vik,vk,vjk,vj...->vi...", vectors, inverse, vectors, g)


def solve_jointly(
    mesh: Mesh, system: FaceSystem, hessians: np.ndarray, gradient: np.ndarray, free: np.ndarray, damping: float
) -> np.ndarray:
    """Steps of all free vertices from one sparse system; zero for the others.

    Args:
        system: normal equations of the faces.
        hessians: (n, 3, 3) float: of the priors.
        gradient: (n, 3) float: of energy and priors; or (n, 3, r): r parts of it, which the same factorization solves.
        free: (n,) bool.
        damping: multiple of the identity that is added to the 3 x 3 block of each vertex, relative to the largest eigenvalue
            of that block.

    Returns:
        (n, 3) or (n, 3, r) float: the step of each gradient, world units.
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
        -gradient[free].reshape(3 * int(free.sum()), *gradient.shape[2:])
    )
    step = np.zeros(gradient.shape)
    step[free] = solution.reshape(-1, *gradient.shape[1:])
    return step


def faded(hessians: np.ndarray, H: np.ndarray) -> np.ndarray:
    """Hessians B (n, 3, 3) float of a prior, faded where normal matrices H (n, 3, 3) float are larger: B (B + H)^-1 B.

    In a direction in which B has the share s of the sum, s B remains.
    """
    total = hessians + H
    least = 1e-9 * np.trace(total, axis1=1, axis2=2) + 1e-300  # both may be singular in the same direction
    result = hessians @ np.linalg.solve(total + least[:, None, None] * np.eye(3), hessians)
    return 0.5 * (result + result.transpose(0, 2, 1))
