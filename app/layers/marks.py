"""Vertex marks: the shapes that represent vertices, and their size.

trimesh offers these shapes, but importing it delays the page (ledger: vertex mark shapes).
"""

from itertools import combinations, product

import numpy as np
import viser

from app.palette import RGB
from app.stage import SIZE, Stage
from fairing.mesh import Mesh

Shape = tuple[np.ndarray, np.ndarray]


def ball(subdivisions: int = 1) -> Shape:
    """Vertices (n, 3) float32 and faces (m, 3) uint32 of a unit sphere, 80 triangles by default."""
    golden = (1 + 5**0.5) / 2
    vertices = np.array(
        [np.roll((0.0, a, b), n) for n in range(3) for a, b in product((1, -1), (golden, -golden))]
    )  # of an icosahedron with edges of length 2
    faces = np.array(
        [f for f in combinations(range(12), 3) if all(_apart(vertices[list(e)]) < 2.1 for e in combinations(f, 2))]
    )
    vertices /= np.linalg.norm(vertices[0])
    for _ in range(subdivisions):
        a, b, c = np.moveaxis(vertices[faces], 1, 0)
        corners = np.stack([a, a + b, c + a, b, b + c, a + b, c, c + a, b + c, a + b, b + c, c + a], axis=1)
        vertices, inverse = np.unique(_unit(corners.reshape(-1, 3)).round(12), axis=0, return_inverse=True)
        faces = inverse.reshape(-1, 3)
    return vertices.astype(np.float32), _outward(vertices, faces)


def octahedron() -> Shape:
    """Vertices (6, 3) float32 and faces (8, 3) uint32, on average seen as large as a unit icosahedron."""
    vertices = 1.18 * np.concatenate([np.eye(3), -np.eye(3)])
    faces = np.array(list(product((0, 3), (1, 4), (2, 5))))
    return vertices.astype(np.float32), _outward(vertices, faces)


def block() -> Shape:
    """Vertices (8, 3) float32 and faces (12, 3) uint32 of a cube slightly larger than the unit sphere."""
    vertices = np.array(list(product((-1.05, 1.05), repeat=3)))
    sides = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]]
    faces = np.array([half for a, b, c, d in sides for half in ((a, b, c), (a, c, d))])
    return vertices.astype(np.float32), _outward(vertices, faces)


def translucent_ball(client: viser.ClientHandle, name: str, color: RGB, opacity: float) -> viser.MeshHandle:
    """A hidden unit sphere, to be placed and scaled around a vertex."""
    return client.scene.add_mesh_simple(
        name, *ball(2), color=color, opacity=opacity, cast_shadow=False, receive_shadow=False, visible=False
    )


def _apart(ends: np.ndarray) -> float:
    return float(np.linalg.norm(ends[1] - ends[0]))


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def _outward(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """The faces (m, 3) uint32 of a convex shape around the origin, all oriented outward."""
    turned = np.linalg.det(vertices[faces]) < 0
    return np.where(turned[:, None], faces[:, ::-1], faces).astype(np.uint32)


def edge_length(stage: Stage, mesh: Mesh) -> float:
    """Median length of the mesh's edges, page units."""
    edges = stage.page_from_world(mesh.vertices)[mesh.edges]
    return float(np.median(np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1)))


def mark_radius(stage: Stage, mesh: Mesh) -> float:
    """Radius of a vertex mark, page units: small compared with the edges, but large enough to click."""
    return float(np.clip(0.07 * edge_length(stage, mesh), 0.0022 * SIZE, 0.009 * SIZE))
