"""The best mesh of a connectivity: its vertices fitted to the true surface itself, without any photo."""

import numpy as np
from scipy.sparse import block_diag, coo_array, csr_array, diags_array, eye_array
from scipy.sparse.linalg import splu

from fairing.geometry.closest_point import SurfaceTree
from fairing.geometry.normals import face_normals
from fairing.mesh import Mesh

SUBDIVISIONS = 8  # of a face's edges; each small triangle's centre is a sample
ROUNDS = 10
DAMPING = 1e-6  # of the normal matrix's mean diagonal


def best_mesh(mesh: Mesh, normals_at: list[np.ndarray], truth: Mesh) -> Mesh:
    """The mesh with its vertices where the squared distance of its surface to the truth is least.

    Gauss-Newton on the distances of samples to the planes of the true faces nearest to them. Vertices move along the
    normals of the true surface only: free to slide, they would draw the mesh together (dome: to a fifth of the distance).

    Args:
        mesh: its vertices on the true surface.
        normals_at: for each vertex (d, 3) float: normals of the true faces that meet there.
        truth: the true surface.
    """
    move = block_diag([np.linalg.qr(normals.T)[0] for normals in normals_at], format="csr")
    tree, area = SurfaceTree(truth), np.linalg.norm(face_normals(mesh.vertices, mesh.faces), axis=1)
    normals = face_normals(truth.vertices, truth.faces)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    weights = _centres()
    n_vertices, n_samples = len(mesh.vertices), len(weights) * len(mesh.faces)
    n_free = sum(min(normals.shape) for normals in normals_at)
    corner = np.repeat(mesh.faces, len(weights), axis=0)
    barycentric = np.tile(weights, (len(mesh.faces), 1))
    importance = np.repeat(area, len(weights))
    vertices, best, least = mesh.vertices, mesh.vertices, np.inf
    for _ in range(ROUNDS):
        points = np.einsum("sk,skx->sx", barycentric, vertices[corner])
        distance, face = tree.closest(points)
        cost = float((importance * distance**2).sum())
        if cost < least:
            best, least = vertices, cost
        residual = (normals[face] * (points - truth.vertices[truth.faces[face, 0]])).sum(axis=1)
        entries = (barycentric[:, :, None] * normals[face][:, None, :]).reshape(n_samples, 9)
        columns = (3 * corner[:, :, None] + np.arange(3)).reshape(n_samples, 9)
        rows = np.repeat(np.arange(n_samples), 9)
        by_coordinate = coo_array((entries.ravel(), (rows, columns.ravel())), shape=(n_samples, 3 * n_vertices))
        J = csr_array(by_coordinate @ move)
        weighed = csr_array(J.T @ diags_array(importance))
        H = csr_array(weighed @ J)
        step = splu((H + DAMPING * H.diagonal().mean() * eye_array(n_free)).tocsc()).solve(-(weighed @ residual))
        vertices = vertices + (move @ step).reshape(-1, 3)
    return mesh.moved(best)


def _centres() -> np.ndarray:
    """(SUBDIVISIONS^2, 3) float: barycentric coordinates of the centres of a triangle's small triangles."""
    k = SUBDIVISIONS
    up = [(i + 1 / 3, j + 1 / 3) for i in range(k) for j in range(k - i)]
    down = [(i + 2 / 3, j + 2 / 3) for i in range(k - 1) for j in range(k - 1 - i)]
    a, b = np.array(up + down).T / k
    return np.column_stack([a, b, 1 - a - b])
