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
    face_normals = _face_normals(points[scene.mesh.faces])
    normals = np.zeros_like(points)
    for k in range(3):
        np.add.at(normals, scene.mesh.faces[:, k], face_normals)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return points - offset_along_normals(vertices, scene, stage) * normals


def offset_along_normals(vertices: np.ndarray, scene: Scene, stage: Stage) -> float:
    """Distance by which vertices are moved against their normals, page units; negative if these point away from the cameras.

    Args:
        vertices: (n, 3) float, world units.
    """
    corners = stage.page_from_world(vertices).astype(np.float64)[scene.mesh.faces]
    sight = stage.camera_centers.mean(0) - corners.mean(1)
    return OFFSET * float(np.sign(np.median(np.einsum("mc,mc->m", _face_normals(corners), sight))))


def _face_normals(corners: np.ndarray) -> np.ndarray:
    """(m, 3) float: normals of faces with corners (m, 3, 3), as long as twice the area."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
