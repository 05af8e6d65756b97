"""Values at every sample of the cells of all faces, and how they are collected from a recorded moment."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from fairing.judge.inspect import FaceCells, cells_of_all_faces
from fairing.run.session import Session


@dataclass(frozen=True, eq=False)
class Texels:
    """Values at the samples of all faces, t samples in all.

    A face has N x N samples in a right triangle, row by row: N - row of them in each row. Sample (row, column) has the
    barycentric weights

        inset + (1 - 3 inset) (column + 1/3) / N   of corner 0,
        inset + (1 - 3 inset) (row + 1/3) / N      of corner 1, the rest of corner 2,

    see `FaceCells` and `fairing.cells.layout.cell_grid`.

    Attributes:
        size: (m,) int: N of each face; 0 for a face that takes no part.
        inset: (m,) float: border that the cells leave out, as a fraction of the face's height.
        start: (m + 1,) int: the samples of face f are `start[f] : start[f + 1]` of `values`.
        values: (t,) or (t, c) float32; NaN where unknown.
        blur: px: the photos were blurred by this much (standard deviation) in the sweep of the moment.
    """

    size: np.ndarray
    inset: np.ndarray
    start: np.ndarray
    values: np.ndarray
    blur: float

    def of_face(self, face: int) -> np.ndarray:
        """(p,) or (p, c) float32: the samples of a face, p = N (N + 1) / 2."""
        return self.values[self.start[face] : self.start[face + 1]]

    def image(self, face: int) -> np.ndarray:
        """(N, N) or (N, N, c) float32: the samples of a face by row and column; NaN outside the triangle too."""
        n = int(self.size[face])
        image = np.full((n, n, *self.values.shape[1:]), np.nan, dtype=np.float32)
        image[np.add.outer(np.arange(n), np.arange(n)) < n] = self.of_face(face)
        return image


def chosen_moment(session: Session, moment: int | None, view: int | None) -> int:
    """The moment to measure, for a photo or all; None: the session's present one.

    Raises:
        IndexError: no such moment or photo.
    """
    moment = session.moment if moment is None else moment
    if not 0 <= moment <= len(session.trace):
        raise IndexError(f"moment {moment}: this run has moments 0 to {len(session.trace)}")
    if view is not None and not 0 <= view < len(session.scene.views):
        raise IndexError(f"photo {view}: this scene has photos 0 to {len(session.scene.views) - 1}")
    return moment


Kind = TypeVar("Kind", bound=Texels)


def measure_texels(
    kind: type[Kind],
    session: Session,
    moment: int,
    view: int | None,
    purpose: str,
    by_sample: Callable[[FaceCells], np.ndarray],
    channels: tuple[int, ...] = (),
) -> Kind:
    """Values at every sample of all faces that take part, with the cells of `fairing.judge.inspect.face_cells`.

    The cells are those of the sweep at the moment: as sharp as the photos at the finest level, blurred before.

    Args:
        kind: the class of the result.
        view: id of a photo: only of the faces in which it takes part; None: of all.
        purpose: reported as the work in progress.
        by_sample: returns the values (p, *channels) float32 of the cells of a face.

    Raises:
        InputError: no photo sees any face well enough.
        Cancelled: the session's cancellation was requested.
    """
    context, n_faces = session.sweep_state(moment).context, len(session.scene.mesh.faces)
    size, by_face = np.zeros(n_faces, dtype=np.int64), [np.zeros((0, *channels), dtype=np.float32)] * n_faces
    for cells in cells_of_all_faces(session, moment, purpose, view):
        size[cells.face] = cells.size
        by_face[cells.face] = by_sample(cells)
    return kind(
        size,
        context.kernel.face_inset,
        np.cumsum([0, *(len(values) for values in by_face)]),
        np.concatenate(by_face),
        session.options.levels[context.level].blur,
    )
