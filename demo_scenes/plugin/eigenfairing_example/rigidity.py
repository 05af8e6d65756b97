"""A term: edges keep the lengths that they have at the beginning of the sweep."""

import numpy as np

import fairing


class Rigidity(fairing.OwnTerm):
    """Edges that are longer or shorter than at the beginning of the sweep."""

    name = "rigidity"
    strength = 0.1  # of what the photos determine at an average vertex

    def begin(self, scene, vertices):
        edges = scene.mesh.edges
        length = np.linalg.norm(vertices[edges[:, 1]] - vertices[edges[:, 0]], axis=1)

        def residual(vertices):
            return np.linalg.norm(vertices[edges[:, 1]] - vertices[edges[:, 0]], axis=1) - length

        return fairing.Residuals(edges, residual)  # the vertices of each residual, and the residuals
