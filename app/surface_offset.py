"""Surface offset: surfaces are drawn slightly behind their true position, so that edges and points appear in front."""

import numpy as np

from app.stage import SIZE, Stage
from fairing.scene import Scene

OFFSET = 0.0015 * SIZE  # page units


def set_back(vertices: np.ndarray, scene: Scene, stage: Stage) -> np.ndarray:
    """Vertices moved along their normals, away from the cameras: (n, 3) float, page units.

    Args:
        vertices: (n, 3) float, world units.
    """
    points = stage.page_from_world(vertices).astype(np.float64)
    corners = points[scene.mesh.faces]
    face_normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros_like(points)
    for k in range(3):
        np.add.at(normals, scene.mesh.faces[:, k], face_normals)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    sight = stage.camera_centers.mean(0) - corners.mean(1)
    towards = np.sign(np.median(np.einsum("mc,mc->m", face_normals, sight)))
    return points - towards * OFFSET * normals
