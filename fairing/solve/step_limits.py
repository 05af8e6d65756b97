"""Step limits: protection against folded faces."""

import numpy as np

from fairing.geometry.normals import folded_faces
from fairing.options import StepOptions


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
