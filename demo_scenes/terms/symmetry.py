"""The mesh is drawn to its own mirror image: `eigenfairing view SCENE --with symmetry.py`.

The plane of symmetry is the one through the middle of the mesh, of the three axes, that maps vertices nearest to vertices. Where a
sweep begins, each vertex is paired with the one nearest to its mirror image; unlike pairs are rejected by the loss.
"""

import numpy as np
from scipy.spatial import KDTree

import fairing


class Symmetry(fairing.OwnTerm):
    """Vertices that lie off the mirror image of their partner."""

    name = "symmetry"
    strength = 0.1

    def begin(self, scene, vertices):
        middle = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
        tree = KDTree(vertices)
        mirrors = [np.where(np.arange(3) == axis, -1.0, 1.0) for axis in range(3)]
        found = [tree.query(middle + (vertices - middle) * mirror) for mirror in mirrors]
        axis = int(np.argmin([np.median(distance) for distance, _ in found]))
        partner, mirror = found[axis][1], mirrors[axis]
        pairs = np.column_stack([np.arange(len(vertices)), partner])
        pairs = pairs[pairs[:, 0] < pairs[:, 1]]

        def residual(vertices):  # three a pair: one for each coordinate
            here, there = vertices[pairs[:, 0]], vertices[pairs[:, 1]]
            return (here - middle - (there - middle) * mirror).ravel()

        loss = fairing.GemanMcClure(0.01 * scene.mesh.diagonal)
        return fairing.Residuals(np.repeat(pairs, 3, axis=0), residual, loss)
