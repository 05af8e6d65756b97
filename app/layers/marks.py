"""The shapes that stand for vertices, and how large they are drawn."""

import numpy as np
import trimesh.creation

from app.stage import SIZE, Stage
from fairing.mesh import Mesh

Shape = tuple[np.ndarray, np.ndarray]


def ball(subdivisions: int = 1) -> Shape:
    """Vertices and faces of a unit sphere, of 80 triangles by default."""
    sphere = trimesh.creation.icosphere(subdivisions=subdivisions)
    return np.asarray(sphere.vertices, dtype=np.float32), np.asarray(sphere.faces, dtype=np.uint32)


def block() -> Shape:
    """Vertices and faces of a cube a little larger than the unit sphere."""
    cube = trimesh.creation.box(extents=(2.1, 2.1, 2.1))
    return np.asarray(cube.vertices, dtype=np.float32), np.asarray(cube.faces, dtype=np.uint32)


def edge_length(stage: Stage, mesh: Mesh) -> float:
    """Median length of the mesh's edges, page units."""
    edges = stage.page_from_world(mesh.vertices)[mesh.edges]
    return float(np.median(np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1)))


def mark_radius(stage: Stage, mesh: Mesh) -> float:
    """Of a vertex's sphere, page units: small beside its edges, but never too small to hit."""
    return float(np.clip(0.07 * edge_length(stage, mesh), 0.0022 * SIZE, 0.009 * SIZE))
