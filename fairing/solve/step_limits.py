"""Step limits: motion of vertices in the photos, capture range, and protection against folded faces."""

from collections.abc import Sequence

import numpy as np

from fairing.geometry.normals import folded_faces
from fairing.options import StepOptions
from fairing.scene import View


def pixels_moved(
    views: Sequence[View], vertex_views: np.ndarray, vertices: np.ndarray, ids: np.ndarray, steps: np.ndarray
) -> np.ndarray:
    """(u,) float: longest displacement of each vertex in a photo, px, to first order.

    Args:
        vertex_views: (n, V) bool: photos that are used for each vertex.
        vertices: (n, 3) float: positions, world units.
        ids: (u,) int: vertices that move.
        steps: (u, 3) float, world units.
    """
    longest = np.zeros(len(ids))
    seen = vertex_views[ids]
    for v in np.flatnonzero(seen.any(axis=0)).tolist():
        rows = np.flatnonzero(seen[:, v])
        J = views[v].camera.J_image_wrt_point(vertices[ids[rows]])
        longest[rows] = np.maximum(longest[rows], np.linalg.norm(np.einsum("nij,nj->ni", J, steps[rows]), axis=1))
    return longest


def pixels_per_unit(views: Sequence[View], vertex_views: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """(n,) float: largest motion of each vertex in a photo, px per world unit; 0 where no photo is used.

    Args: see `pixels_moved`.
    """
    longest = np.zeros(len(vertices))
    for v, view in enumerate(views):
        ids = np.flatnonzero(vertex_views[:, v])
        J = view.camera.J_image_wrt_point(vertices[ids])
        longest[ids] = np.maximum(longest[ids], np.linalg.norm(J, 2, axis=(1, 2)) if len(ids) else 0)
    return longest


def unfolded(
    vertices: np.ndarray,
    ids: np.ndarray,
    steps: np.ndarray,
    start: np.ndarray,
    faces: np.ndarray,
    options: StepOptions,
) -> tuple[np.ndarray, np.ndarray]:
    """Steps (u, 3) float shortened until no face folds or collapses, world units; and (u,) bool: whose steps were shortened.

    They are halved three times, then given up.

    Args:
        vertices: (n, 3) float: positions, world units.
        ids: (u,) int: vertices that move.
        steps: (u, 3) float, world units.
        start: (n, 3) float: positions at the start of the run; a face that was thin there may stay thin.
        faces: (m, 3) int.
    """
    tried, folds = steps.copy(), np.zeros(len(ids), dtype=bool)
    after = vertices.copy()
    attempt = 0
    while True:
        after[ids] = vertices[ids] + tried
        hit = np.isin(ids, faces[folded_faces(vertices, after, start, faces, options)])
        folds |= hit
        if not tried[hit].any():
            return tried, folds
        tried[hit] *= 0.5 if attempt < 3 else 0.0
        attempt += 1
