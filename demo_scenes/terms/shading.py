"""Normals are turned until the brightness of the faces agrees with one light: `eigenfairing view SCENE --with shading.py`.

Shape from shading in its simplest form: a face with the unit normal n has the grey level a + b . n, from ambient and directed
light, where one albedo of the whole mesh is part of a and b. Both are estimated where a sweep begins, from the faces as they lie
there. Textures, cast shadows, highlights and photos of different exposure contradict it. The loss rejects single faces that do, but
a textured surface, such as those of the demo scenes, becomes worse with this term: it is for casts, marble and painted parts.
"""

import numpy as np

import fairing

LUMA = np.array([0.299, 0.587, 0.114])
SCALE = 5.0  # grey levels: faces farther off are of another albedo or in a shadow


class Shading(fairing.OwnTerm):
    """Differences of the faces' brightness from that of one albedo under one light, grey levels."""

    name = "shading"
    strength = 0.1

    def begin(self, scene, vertices):
        pixels, brightness = np.zeros((2, len(scene.mesh.faces)))
        for view in scene.views:
            face, _ = fairing.rasterize(vertices, scene.mesh.faces, view.camera)
            used = face >= 0 if view.mask is None else (face >= 0) & view.mask.load()
            pixels += np.bincount(face[used], minlength=len(pixels))
            brightness += np.bincount(face[used], view.photo.load()[used] @ LUMA, len(pixels))
        faces = scene.mesh.faces[pixels > 0]
        brightness = brightness[pixels > 0] / pixels[pixels > 0]

        loss = fairing.GemanMcClure(SCALE)
        shapes = np.column_stack([np.ones(len(faces)), normals_of(vertices[faces])])
        light = np.linalg.lstsq(shapes, brightness)[0]
        for _ in range(10):  # reweighted: without the faces of another albedo
            weight = np.sqrt(loss.weight(shapes @ light - brightness) * pixels[pixels > 0])[:, None]
            light = np.linalg.lstsq(weight * shapes, weight[:, 0] * brightness)[0]

        def residual(vertices):
            return light[0] + normals_of(vertices[faces]) @ light[1:] - brightness

        return fairing.Residuals(faces, residual, loss)


def normals_of(corners):
    """(m, 3) float: unit normals of triangles (m, 3, 3)."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)
