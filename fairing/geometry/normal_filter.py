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
    faces, places = mesh.faces, vertices.copy()
    normals, area = unit_normals(vertices, faces)
    here, there = _neighbours(faces, len(vertices))
    for _ in range(NORMAL_PASSES):
        difference = ((normals[here] - normals[there]) ** 2).sum(axis=1)
        weight = area[there] * np.exp(-difference / (2 * NORMAL_SIGMA**2))
        total = area[:, None] * normals
        np.add.at(total, here, weight[:, None] * normals[there])
        normals = total / np.maximum(np.linalg.norm(total, axis=1), 1e-300)[:, None]
    count = np.maximum(np.bincount(faces.ravel(), minlength=len(vertices)), 1)
    for _ in range(vertex_passes):
        center = places[faces].mean(axis=1)
        move = np.zeros_like(places)
        for corner in range(3):
            distance = ((center - places[faces[:, corner]]) * normals).sum(axis=1)
            np.add.at(move, faces[:, corner], distance[:, None] * normals)
        places += move / count[:, None]
    return places


def _neighbours(faces: np.ndarray, n_vertices: int) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of faces that share a vertex, in both orders, as two int arrays of one length."""
    rows = np.repeat(np.arange(len(faces)), 3)
    uses = coo_array((np.ones(len(rows)), (rows, faces.ravel())), shape=(len(faces), n_vertices)).tocsr()
    here, there = (uses @ uses.T).tocoo().coords
    return here[here != there], there[here != there]
