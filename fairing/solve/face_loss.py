"""Photo loss of faces, per photo pixel."""

import numpy as np

from fairing.cells.context import CellContext


def loss_of_faces(context: CellContext, energy: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Loss per photo pixel of faces, (F,) float, and their pixels in all photos, (F,) float.

    The loss is divided by the degrees of freedom, (n - k) / n, so that a face seen by few photos does not appear to fit
    better. Both are 0 where fewer than three photos see the face.

    Args:
        energy: (F,) float: of the faces.
        faces: (F,) int, ids.
    """
    data = context.kernel
    samples = np.diff(data.grid_start)[data.face_grid]
    views = np.diff(data.pair_start)
    total = np.concatenate([[0], np.cumsum(data.pair_weight * np.repeat(samples, views))])
    pixels = (total[data.pair_start[1:]] - total[data.pair_start[:-1]])[faces]
    k, n = data.face_dimensions[faces], views[faces]
    pixels[k == 0] = 0
    return np.where(k > 0, energy / np.maximum(pixels, 1e-12) * n / np.maximum(n - k, 1), 0.0), pixels
