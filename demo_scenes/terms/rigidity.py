"""Every edge keeps the length it has where a sweep begins: `eigenfairing view SCENE --with rigidity.py`.

The simplest form of an as-rigid-as-possible prior (Sorkine and Alexa 2007): the mesh bends, but does not stretch.
"""

import numpy as np

import fairing


class Rigidity(fairing.OwnTerm):
    """Edges that are longer or shorter than at the beginning of the sweep."""

    name = "rigidity"
    strength = 0.1

    def begin(self, scene, vertices):
        edges = scene.mesh.edges
        length = np.linalg.norm(vertices[edges[:, 1]] - vertices[edges[:, 0]], axis=1)

        def residual(vertices):
            return np.linalg.norm(vertices[edges[:, 1]] - vertices[edges[:, 0]], axis=1) - length

        return fairing.Residuals(edges, residual)
