"""Photo loss of faces and of the faces around vertices, per photo pixel."""

import numpy as np

from fairing.cells.context import CellContext
from fairing.geometry.normals import face_normals
from fairing.mesh import Mesh
from fairing.solve.blocks import Block


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


def mean_loss(
    context: CellContext, energy: np.ndarray, block: Block, vertices: np.ndarray, mesh: Mesh, unseen_loss: float
) -> np.ndarray:
    """(u,) float: mean loss per photo pixel of the faces around each vertex of a block, weighted by their footprints.

    Args:
        energy: (F,) float: of the faces of the block.
        vertices: (n, 3) float: positions, world units.
        unseen_loss: loss of a face that fewer than three photos see; such a face has half weight.
    """
    faces = block.faces
    loss, pixels = loss_of_faces(context, energy, faces)
    seen = pixels > 0
    loss[~seen] = unseen_loss
    surface = np.linalg.norm(face_normals(vertices, mesh.faces[faces]), axis=1)
    area = np.where(seen, context.footprint_area[faces], 0)

    def by_vertex(values: np.ndarray) -> np.ndarray:
        return np.bincount(block.owner, weights=values, minlength=len(block.vertices))

    pixels_per_surface = by_vertex(area) / np.maximum(by_vertex(np.where(seen, surface, 0)), 1e-300)
    weight = np.where(seen, area, 0.5 * surface * pixels_per_surface[block.owner])
    total = by_vertex(weight)
    return np.where(total > 0, by_vertex(weight * loss) / np.maximum(total, 1e-300), unseen_loss)
