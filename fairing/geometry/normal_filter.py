"""Normal filter: feature-preserving denoising of a mesh, by geometry alone.

It applies to vertices that no photo determines and to starts with random errors, which are constrained by nothing but the
faces around them. Normals of neighbouring faces are averaged where they are similar (Zheng, Fu, Au, Tai: Bilateral Normal
Filtering for Mesh Denoising, TVCG 2011), and vertices are moved until the faces have these normals (Sun, Rosin, Martin,
Langbein: Fast and Effective Feature-Preserving Mesh Denoising, TVCG 2007). Smoothing positions instead rounds off the features
of coarse meshes (ledger: normal filter).
"""

import numpy as np
from scipy.sparse import coo_array

from fairing.geometry.normals import unit_normals
from fairing.mesh import Mesh

NORMAL_SIGMA = 0.2  # scale of the similarity of unit normals, by the length of their difference; beyond it is a crease
NORMAL_PASSES = 3


def smoothed(mesh: Mesh, vertices: np.ndarray, vertex_passes: int) -> np.ndarray:
    """Move vertices towards the filtered planes of their faces.

    Args:
        vertices: (n, 3) float, world units.
        vertex_passes: number of passes; each moves a vertex by its mean distance to those planes.

    Returns:
        (n, 3) float, world units.
    """
    normals, places = filtered_normals(mesh, vertices), vertices
    for _ in range(vertex_passes):
        places = places + moves_to_planes(mesh, places, normals)
    return places


def filtered_normals(mesh: Mesh, vertices: np.ndarray) -> np.ndarray:
    """(m, 3) float: unit normals of the faces with vertices (n, 3), averaged with similar ones of neighbouring faces."""
    faces = mesh.faces
    normals, area = unit_normals(vertices, faces)
    here, there = _neighbours(faces, len(vertices))
    for _ in range(NORMAL_PASSES):
        difference = ((normals[here] - normals[there]) ** 2).sum(axis=1)
        weight = area[there] * np.exp(-difference / (2 * NORMAL_SIGMA**2))
        total = area[:, None] * normals
        np.add.at(total, here, weight[:, None] * normals[there])
        normals = total / np.maximum(np.linalg.norm(total, axis=1), 1e-300)[:, None]
    return normals


def moves_to_planes(mesh: Mesh, vertices: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """(n, 3) float: mean distance of each vertex (n, 3) from the planes through the centres of its faces, world units.

    Args:
        normals: (m, 3) float: unit normals of these planes.
    """
    count = np.maximum(np.bincount(mesh.faces.ravel(), minlength=len(vertices)), 1)
    move = np.zeros_like(vertices)
    for corner, distance in enumerate(_off_planes(mesh, vertices, normals).T):
        np.add.at(move, mesh.faces[:, corner], distance[:, None] * normals)
    return move / count[:, None]


def planes_energy(mesh: Mesh, vertices: np.ndarray, normals: np.ndarray) -> float:
    """Sum of the squared distances of the corners from these planes, world units^2; arguments as of `moves_to_planes`."""
    return float((_off_planes(mesh, vertices, normals) ** 2).sum())


def _off_planes(mesh: Mesh, vertices: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """(m, 3) float: distance of the plane through the centre of each face from each of its corners, along its normal."""
    corners = vertices[mesh.faces]
    return ((corners.mean(axis=1)[:, None] - corners) * normals[:, None]).sum(axis=2)


def _neighbours(faces: np.ndarray, n_vertices: int) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of faces that share a vertex, in both orders, as two int arrays of one length."""
    rows = np.repeat(np.arange(len(faces)), 3)
    uses = coo_array((np.ones(len(rows)), (rows, faces.ravel())), shape=(len(faces), n_vertices)).tocsr()
    here, there = (uses @ uses.T).tocoo().coords
    return here[here != there], there[here != there]
