"""Residuals at every sample of the cells, in one photo or over all: where in a face the photos disagree."""

from dataclasses import dataclass

import numpy as np

from fairing.judge.inspect import FaceCells, cells_of_all_faces
from fairing.run.session import Session


@dataclass(frozen=True, eq=False)
class TexelResiduals:
    """Absolute residuals |I - U c| at the samples of all faces, in one photo or means over photos; t samples in all.

    A face has N x N samples in a right triangle, row by row: N - row of them in each row. Sample (row, column) has the
    barycentric weights

        inset + (1 - 3 inset) (column + 1/3) / N   of corner 0,
        inset + (1 - 3 inset) (row + 1/3) / N      of corner 1, the rest of corner 2,

    see `FaceCells` and `fairing.cells.layout.cell_grid`.

    Attributes:
        size: (m,) int: N of each face; 0 for a face that takes no part.
        inset: (m,) float: border that the cells leave out, as a fraction of the face's height.
        start: (m + 1,) int: the samples of face f are `start[f] : start[f + 1]` of `values`.
        values: (t,) float32, grey levels, the mean of the channels with colour; NaN where no photo shows the sample.
        blur: px: the photos were blurred by this much (standard deviation) in the sweep of the moment.
    """

    size: np.ndarray
    inset: np.ndarray
    start: np.ndarray
    values: np.ndarray
    blur: float

    def of_face(self, face: int) -> np.ndarray:
        """(p,) float32, grey levels: the samples of a face, p = N (N + 1) / 2."""
        return self.values[self.start[face] : self.start[face + 1]]

    def image(self, face: int) -> np.ndarray:
        """(N, N) float32, grey levels: the samples of a face by row and column; NaN outside the triangle too."""
        n = int(self.size[face])
        image = np.full((n, n), np.nan, dtype=np.float32)
        image[np.add.outer(np.arange(n), np.arange(n)) < n] = self.of_face(face)
        return image


def texel_residuals(session: Session, moment: int | None = None, view: int | None = None) -> TexelResiduals:
    """Residuals at every sample of all faces that take part, with the cells of `fairing.judge.inspect.face_cells`.

    The cells are those of the sweep at the moment: as sharp as the photos at the finest level, blurred before.

    Args:
        moment: default: the session's present moment.
        view: id of a photo; default: each sample has the mean over the photos that show it.

    Raises:
        IndexError: no such moment or photo.
        InputError: no photo sees any face well enough.
        Cancelled: the session's cancellation was requested.
    """
    moment = session.moment if moment is None else moment
    n_views, n_faces = len(session.scene.views), len(session.scene.mesh.faces)
    if not 0 <= moment <= len(session.trace):
        raise IndexError(f"moment {moment}: this run has moments 0 to {len(session.trace)}")
    if view is not None and not 0 <= view < n_views:
        raise IndexError(f"photo {view}: this scene has photos 0 to {n_views - 1}")
    context = session.sweep_state(moment).context
    size, by_face = np.zeros(n_faces, dtype=np.int64), [np.zeros(0, dtype=np.float32)] * n_faces
    for cells in cells_of_all_faces(session, moment, "measuring residuals", view):
        size[cells.face] = cells.size
        by_face[cells.face] = _by_sample(cells, slice(None) if view is None else cells.views == view)
    return TexelResiduals(
        size,
        context.kernel.face_inset,
        np.cumsum([0, *(len(values) for values in by_face)]),
        np.concatenate(by_face),
        session.options.levels[context.level].blur,
    )


def _by_sample(cells: FaceCells, chosen: np.ndarray | slice) -> np.ndarray:
    """(p,) float32: |e| of each sample over the chosen cells that show it; NaN where none does."""
    residual, counts = np.abs(cells.residual[chosen]), cells.counts[chosen]
    total, count = (
        each.reshape(-1, len(cells.rows_and_columns[0])).sum(axis=0) for each in (np.where(counts, residual, 0), counts)
    )
    return np.divide(total, count, out=np.full(total.shape, np.nan, dtype=np.float32), where=count > 0)
