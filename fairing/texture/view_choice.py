"""Choice of views for textures: how well each photo shows each face, and the photos that paint it."""

from collections.abc import Callable

import numpy as np

from fairing.geometry.normals import unit_normals
from fairing.geometry.rasterize import rasterize
from fairing.scene import Scene

VIEWS_PER_FACE = 8
SMALLEST_SINE = np.sin(np.radians(12.0))  # of the angle between line of sight and face
LEAST_SCORE = 0.2  # fraction of the best photo's score: photos of much lower resolution only blur the face


def survey(scene: Scene, vertices: np.ndarray, on_progress: Callable[[float], None]) -> tuple[np.ndarray, np.ndarray]:
    """Score each view for each face, and measure the faces' edges in the photos that see them best.

    Args:
        vertices: (n, 3) float, world units.
        on_progress: callback with the completed fraction, 0 to 1.

    Returns:
        scores: (m, V) float32: pixels that show the face, times the sine of the viewing angle and the photo's weight.
        edges: (m, 3) float, px.
    """
    faces = scene.mesh.faces
    corners = vertices[faces]
    normals, _ = unit_normals(vertices, faces)
    scores = np.zeros((len(faces), len(scene.views)), dtype=np.float32)
    edges = np.zeros((len(faces), 3))
    best = np.zeros(len(faces))
    for v, view in enumerate(scene.views):
        face_id, _ = rasterize(vertices, faces, view.camera)
        if view.mask is not None:
            face_id[~view.mask.load()] = -1
        pixels = np.bincount(face_id[face_id >= 0], minlength=len(faces))
        sight = view.camera.center - corners.mean(axis=1)
        sine = np.abs((normals * sight).sum(axis=1)) / np.maximum(np.linalg.norm(sight, axis=1), 1e-300)
        scores[:, v] = np.where(sine > SMALLEST_SINE, pixels * sine * view.weight, 0)
        is_better = scores[:, v] > best
        best = np.maximum(best, scores[:, v])
        uv, _ = view.camera.project(vertices)
        around = uv[faces[is_better]]
        edges[is_better] = np.linalg.norm(np.roll(around, -1, axis=1) - around, axis=2)
        on_progress((v + 1) / len(scene.views))
    return scores, edges


def chosen_views(scores: np.ndarray) -> np.ndarray:
    """(m, VIEWS_PER_FACE) int: the views that paint each face, best first, -1 for none, from scores (m, V)."""
    order = np.argsort(-scores, axis=1, kind="stable")[:, :VIEWS_PER_FACE]
    found = np.take_along_axis(scores, order, axis=1)
    chosen = np.full((len(scores), VIEWS_PER_FACE), -1)
    chosen[:, : order.shape[1]] = np.where((found > 0) & (found >= LEAST_SCORE * found[:, :1]), order, -1)
    return chosen
