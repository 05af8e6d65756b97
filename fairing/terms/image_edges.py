"""Term of the image edges: distances of the creases of a mesh from edges in the photos, with the Geman-McClure loss.

    sum_s w_s rho(offset_s - sum_i d_si . x_i)

for every segment s of a crease that a photo shows: its offset to the strongest image edge nearby, measured along the normal of the
projected crease, and the derivatives of its place in the photo by the ends of the crease. (ledger: creases)
"""

from collections.abc import Sequence
from concurrent.futures import Executor

import numpy as np

from fairing.creases.edges import Creases, find_creases
from fairing.creases.offsets import Offsets, measure_offsets
from fairing.optimize.loss import GemanMcClure
from fairing.optimize.rows import Rows
from fairing.photo import grey_levels
from fairing.scene import View
from fairing.terms.names import IMAGE_EDGES

# px: largest offset, and scale of the loss, in each sweep; the last holds for all further ones. (ledger: stages of the alignment)
SEARCHES = ((6.0, 2.0), (3.5, 1.2), (2.0, 0.5))


def offsets_in(view: View, vertices: np.ndarray, faces: np.ndarray, creases: Creases, reach: float) -> Offsets:
    """Offsets of creases in a photo; arguments as of `measure_offsets`."""
    return measure_offsets(grey_levels(view.photo.full_depth()), view.camera, vertices, faces, creases, reach)


def image_edges(
    views: Sequence[View],
    vertices: np.ndarray,
    faces: np.ndarray,
    orientation: int,
    search: tuple[float, float],
    executor: Executor,
) -> Rows:
    """The term of the creases of a mesh; offsets are those of its vertices, px.

    Args:
        vertices: (n, 3) float, world units.
        faces: (m, 3) int.
        orientation: see `find_creases`.
        search: largest offset, and scale of the loss, px.
        executor: runs one task for each photo; the result does not depend on it.
    """
    creases, (reach, scale) = find_creases(vertices, faces, orientation), search

    def measured(view: View) -> Offsets:
        return offsets_in(view, vertices, faces, creases, reach)

    found = Offsets(*(np.concatenate(part) for part in zip(*executor.map(measured, views), strict=True)))
    derivatives = np.stack([1 - found.along, found.along], axis=1)[:, :, None] * found.px_per_move[:, None]
    ends = creases.ends[found.crease]
    return Rows(IMAGE_EDGES, ends, derivatives, -found.offset, vertices, found.weight, GemanMcClure(scale))
