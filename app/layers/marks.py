"""The shapes that stand for vertices, and how large they are drawn.

trimesh has these shapes, too, but it takes a quarter of a second to import, and the page waits for that.
"""

from itertools import combinations, product

import numpy as np

from app.stage import SIZE, Stage
from fairing.mesh import Mesh

Shape = tuple[np.ndarray, np.ndarray]


def ball(subdivisions: int = 1) -> Shape:
    """Vertices and faces of a unit sphere, of 80 triangles by default."""
    golden = (1 + 5**0.5) / 2
    vertices = np.array(
        [np.roll((0.0, a, b), n) for n in range(3) for a, b in product((1, -1), (golden, -golden))]
    )  # of an icosahedron, whose edges are 2 long
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


def block() -> Shape:
    """Vertices and faces of a cube a little larger than the unit sphere."""
    vertices = np.array(list(product((-1.05, 1.05), repeat=3)))
    sides = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]]
    faces = np.array([half for a, b, c, d in sides for half in ((a, b, c), (a, c, d))])
    return vertices.astype(np.float32), _outward(vertices, faces)


def _apart(ends: np.ndarray) -> float:
    return float(np.linalg.norm(ends[1] - ends[0]))


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def _outward(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """The faces (m, 3) of a convex shape about the origin, uint32, all seen from outside."""
    turned = np.linalg.det(vertices[faces]) < 0
    return np.where(turned[:, None], faces[:, ::-1], faces).astype(np.uint32)


def edge_length(stage: Stage, mesh: Mesh) -> float:
    """Median length of the mesh's edges, page units."""
    edges = stage.page_from_world(mesh.vertices)[mesh.edges]
    return float(np.median(np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1)))


def mark_radius(stage: Stage, mesh: Mesh) -> float:
    """Of a vertex's sphere, page units: small beside its edges, but never too small to hit."""
    return float(np.clip(0.07 * edge_length(stage, mesh), 0.0022 * SIZE, 0.009 * SIZE))
