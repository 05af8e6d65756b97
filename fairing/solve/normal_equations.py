"""Normal equations of the photos by vertex, and the solution of damped Gauss-Newton steps of all terms."""

import numpy as np
from scipy.sparse import bsr_array, coo_array, csc_array, diags_array
from scipy.sparse.linalg import splu

from fairing.mesh import Mesh
from fairing.solve.energy import FaceSystem


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
    is_known = values > 1e-9 * largest
    inverse = is_known / np.where(is_known, values + damping[:, None] * largest, 1)
    return -np.einsum("vik,vk,vjk,vj...->vi...", vectors, inverse, vectors, g)


def solve_jointly(
    mesh: Mesh, system: FaceSystem, others: csc_array, gradient: np.ndarray, free: np.ndarray, damping: float
) -> np.ndarray:
    """Steps of all free vertices from one sparse system; zero for the others.

    Args:
        system: normal equations of the faces.
        others: (3 n, 3 n): normal matrix of the other terms, energy / world unit^2.
        gradient: (n, 3) float: of all terms; or (n, 3, r): r parts of it, which the same factorization solves.
        free: (n,) bool.
        damping: multiple of the identity that is added to the 3 x 3 block of each vertex, relative to the largest eigenvalue
            of that block.

    Returns:
        (n, 3) or (n, 3, r) float: the step of each gradient, world units.
    """
    n = len(mesh.vertices)
    # As narrow as the sparse matrix's own indices: rows and columns are long.
    index = (3 * mesh.faces[system.faces][:, :, None] + np.arange(3)).reshape(-1, 9).astype(np.int32)
    rows, columns = np.repeat(index, 9, axis=1).ravel(), np.tile(index, (1, 9)).ravel()
    photos = coo_array((system.H.ravel(), (rows, columns)), shape=(3 * n, 3 * n)).tocsc()
    H = csc_array(photos + others)
    strength = np.maximum(np.linalg.eigvalsh(_diagonal_blocks(H))[:, 2], 0)
    typical = np.median(strength[free & (strength > 0)]) if (free & (strength > 0)).any() else 1.0
    # Far below every other eigenvalue; the last keeps vertices without information determined.
    added = damping * strength + 1e-6 * strength + 1e-9 * typical
    kept = np.flatnonzero(np.repeat(free, 3))
    matrix = csc_array(H + diags_array(np.repeat(added, 3)))[:, kept][kept]
    solution = splu(matrix, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}).solve(
        -gradient.reshape(3 * n, *gradient.shape[2:])[kept]
    )
    step = np.zeros(gradient.shape)
    step[free] = solution.reshape(-1, *gradient.shape[1:])
    return step


def _diagonal_blocks(matrix: csc_array) -> np.ndarray:
    """(n, 3, 3) float: the blocks of the vertices of a matrix (3 n, 3 n)."""
    blocks = bsr_array(matrix, blocksize=(3, 3))
    row = np.repeat(np.arange(len(blocks.indptr) - 1), np.diff(blocks.indptr))
    own = row == blocks.indices
    result = np.zeros((len(blocks.indptr) - 1, 3, 3))
    result[row[own]] = blocks.data[own]
    return result
