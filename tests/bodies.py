"""Bodies of known shape, and views from all sides."""

from itertools import product

import numpy as np

from fairing.scene import View
from fairing.triangulation import FlipTrace, TriangulationOptions, start_mesh
from tests.terrain_scene import BLANK, pinhole, seen_points

DIRECTIONS = np.array(list(product((-1, 0, 1), repeat=3)), float)
DIRECTIONS = DIRECTIONS[np.linalg.norm(DIRECTIONS, axis=1) > 0] + 0.01
AROUND = tuple(
    View(f"p{i}", pinhole(5 * d / np.linalg.norm(d), [0, 0, 0], up=(0.3, 0.2, 0.9)), BLANK)
    for i, d in enumerate(DIRECTIONS)
)


def points_of(kind: str, n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Points on a surface and its outward normals."""
    if kind == "sphere":
        normals = rng.standard_normal((n, 3))
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        return normals.copy(), normals
    if kind == "box":
        points, side = rng.uniform(-1, 1, (n, 3)), rng.integers(0, 6, n)
        normals = np.zeros((n, 3))
        normals[np.arange(n), side % 3] = np.where(side < 3, 1, -1)
        points[np.arange(n), side % 3] = np.where(side < 3, 1, -1)
        return points, normals
    turn, tube = rng.uniform(0, 2 * np.pi, (2, n))
    normals = np.column_stack([np.cos(tube) * np.cos(turn), np.cos(tube) * np.sin(turn), np.sin(tube)])
    return np.column_stack([np.cos(turn), np.sin(turn), np.zeros(n)]) + 0.4 * normals, normals


def faces_of_sight(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """(V, n) bool: cameras that a point of a convex body, or of a torus seen steeply enough, faces."""
    sight = np.array([view.camera.center for view in AROUND])[:, None] - points
    return (sight * normals).sum(axis=2) > 0.3 * np.linalg.norm(sight, axis=2)


def carved(kind: str = "torus", n: int = 700) -> FlipTrace:
    """A record without flips of a body carved out of n points."""
    points, normals = points_of(kind, n, np.random.default_rng(1))
    mesh = start_mesh(
        AROUND, seen_points(points, faces_of_sight(points, normals), AROUND), TriangulationOptions(spacing=40)
    )
    return FlipTrace({}, mesh.vertices, mesh.faces, mesh.carving)
