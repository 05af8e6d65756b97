"""Surface offset: surfaces are drawn slightly behind their true position, so that edges and points appear in front."""

import numpy as np

from app.stage import SIZE, Stage
from fairing.geometry.normals import face_normals
from fairing.scene import Scene

OFFSET = 0.0015 * SIZE  # page units


def set_back(vertices: np.ndarray, scene: Scene, stage: Stage) -> np.ndarray:
    """Vertices moved along their normals, away from the cameras: (n, 3) float, page units.

    Args:
        vertices: (n, 3) float, world units.
    """
    points, faces = stage.page_from_world(vertices).astype(np.float64), scene.mesh.faces
    doubled = face_normals(points, faces)
    normals = np.zeros_like(points)
    for k in range(3):
        np.add.at(normals, faces[:, k], doubled)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return points - _offset(points[faces], doubled, stage) * normals


def offset_along_normals(vertices: np.ndarray, scene: Scene, stage: Stage) -> float:
    """Distance by which vertices are moved against their normals, page units; negative if these point away from the cameras.

    Args:
        vertices: (n, 3) float, world units.
    """
    points, faces = stage.page_from_world(vertices).astype(np.float64), scene.mesh.faces
    return _offset(points[faces], face_normals(points, faces), stage)


def _offset(corners: np.ndarray, normals: np.ndarray, stage: Stage) -> float:
    """See `offset_along_normals`; corners (m, 3, 3) and normals (m, 3) of the faces, page units."""
    sight = stage.camera_centers.mean(0) - corners.mean(1)
    return OFFSET * float(np.sign(np.median(np.einsum("mc,mc->m", normals, sight))))
