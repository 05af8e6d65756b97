"""Neighbouring faces that are nearly in one plane are drawn into one: `eigenfairing view SCENE --with planarity.py`."""

import numpy as np

import fairing

NEARLY = np.cos(np.radians(15.0))  # cosine of the largest angle between such faces


class Planarity(fairing.OwnTerm):
    """Corners of neighbouring faces that lie off each other's plane, where both nearly share one."""

    name = "planarity"
    strength = 0.3

    def begin(self, scene, vertices):
        sides = pairs_of_faces(scene.mesh.faces)
        a, b, c, d = vertices[sides].transpose(1, 0, 2)
        one, other = np.cross(b - a, c - a), np.cross(d - a, b - a)
        cosine = (one * other).sum(axis=1) / (np.linalg.norm(one, axis=1) * np.linalg.norm(other, axis=1))
        sides = sides[cosine > NEARLY]

        def residual(vertices):  # distance of the corner d from the plane of a, b, c
            a, b, c, d = vertices[sides].transpose(1, 0, 2)
            normal = np.cross(b - a, c - a)
            return ((d - a) * normal).sum(axis=1) / np.linalg.norm(normal, axis=1)

        return fairing.Residuals(sides, residual)


def pairs_of_faces(faces):
    """(r, 4) int: the ends of each inner edge, and the corners of its two faces beside it."""
    first = {}
    found = []
    for corners in faces.tolist():
        for k in range(3):
            a, b, c = corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]
            if (b, a) in first:
                found.append((b, a, first[b, a], c))
            first[a, b] = c
    return np.array(found, dtype=int).reshape(-1, 4)
