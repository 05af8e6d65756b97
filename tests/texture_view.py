"""A textured model seen from a camera, drawn independently of `fairing.texture`."""

import cv2
import numpy as np
import trimesh

from fairing.camera import Camera
from fairing.geometry.rasterize import rasterize
from fairing.texture import TexturedModel


def shown_in(model: TexturedModel, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """The model in a camera (h, w, 3), looked up by its texture coordinates alone, and where it is (h, w)."""
    face_id, depth = rasterize(model.vertices, model.faces, camera)
    rows, columns = np.nonzero(face_id >= 0)
    face = face_id[rows, columns]
    rays = depth[rows, columns] * np.stack([columns, rows, np.ones(len(rows))])
    points = np.linalg.solve(camera.image_from_world[:, :3], rays - camera.image_from_world[:, 3:]).T
    weights = trimesh.triangles.points_to_barycentric(model.vertices[model.faces[face]], points)
    uv = np.einsum("qc,qcx->qx", weights, model.uv[face])
    height, width = model.image.shape[:2]
    x, y = (uv * (width, height) - 0.5).astype(np.float32).T
    colors = cv2.remap(model.image.astype(np.float32), x[None], y[None], cv2.INTER_LINEAR)[0]
    image = np.zeros((camera.height, camera.width, 3))
    image[rows, columns] = colors
    return image, face_id >= 0


def inner(is_shown: np.ndarray) -> np.ndarray:
    """The pixels (h, w) bool at least two pixels away from the outline."""
    return cv2.erode(is_shown.astype(np.uint8), np.ones((5, 5), np.uint8), borderValue=0) > 0
