"""The outline of the mesh is drawn to that of the masks: `eigenfairing view SCENE --with silhouettes.py`.

The masks show what the mesh models, whole, and nothing else. Where a sweep begins, the vertices of the outline are found: between a
face that looks at the camera and one that does not, or none, and near the border of the mesh's own image; contours within the
image do not count. On a curved surface a vertex beside the contour belongs inside the mask, by up to a sixth of the square of an
edge's length over the radius of curvature: it is drawn outwards by that, so coarse meshes of round objects swell.
"""

import cv2
import numpy as np
from scipy.ndimage import map_coordinates

import fairing

NEAR = 5.0  # px: a contour farther from the border of the mesh's image is not its outline
SCALE = 10.0  # px: vertices farther from the masks' border hardly count


class Silhouettes(fairing.OwnTerm):
    """Distances of the mesh's outline from that of the masks, px."""

    name = "silhouettes"
    strength = 0.3

    def begin(self, scene, vertices):
        masks = [(view.camera, view.mask.load()) for view in scene.views if view.mask is not None]
        masks = [(camera, mask) for camera, mask in masks if not mask.all()]
        if not masks:
            raise fairing.InputError("term silhouettes: expected photos with masks, found none; see --masks")
        faces = scene.mesh.faces
        a, b, c = vertices[faces].transpose(1, 0, 2)
        normals = np.cross(b - a, c - a)
        outlines = []
        for camera, mask in masks:
            towards = ((camera.center - a) * normals).sum(axis=1) > 0
            ends = np.concatenate([faces[~towards].ravel(), scene.mesh.boundary_vertices])
            contour = np.intersect1d(faces[towards], ends)
            seen = fairing.rasterize(vertices, faces, camera)[0] >= 0
            near = np.abs(at(vertices[contour], camera, depth_inside(seen))) < NEAR
            outlines.append((contour[near], camera, depth_inside(mask)))
        ids = np.concatenate([contour for contour, _, _ in outlines])[:, None]

        def residual(vertices):
            return np.concatenate([at(vertices[contour], camera, depth) for contour, camera, depth in outlines])

        return fairing.Residuals(ids, residual, fairing.GemanMcClure(SCALE))


def depth_inside(mask):
    """(height, width) float: how far each pixel lies within a mask, px; negative outside."""
    parts = [part.astype(np.uint8) for part in (mask, ~mask)]
    inside, outside = (cv2.distanceTransform(part, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) for part in parts)
    return np.where(mask, inside - 0.5, 0.5 - outside).astype(float)


def at(points, camera, image):
    """(n,) float: values of an image, between its pixels, where a camera sees points (n, 3); far from it 1000."""
    u, v = camera.project(points)[0].T
    return map_coordinates(image, [v, u], order=1, cval=1000.0)
