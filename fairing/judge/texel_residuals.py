"""Residuals at every sample of the cells, in one photo or over all: where in a face the photos disagree."""

from dataclasses import dataclass

import numpy as np

from fairing.judge.inspect import FaceCells
from fairing.judge.texels import Texels, chosen_moment, measure_texels
from fairing.run.session import Session


@dataclass(frozen=True, eq=False)
class TexelResiduals(Texels):
    """Absolute residuals |I - U c| at the samples of all faces, in one photo or means over photos.

    The values are (t,), grey levels, the mean of the channels with colour; NaN where no photo shows the sample.
    """


def texel_residuals(session: Session, moment: int | None = None, view: int | None = None) -> TexelResiduals:
    """Residuals at every sample of all faces that take part, see `fairing.judge.texels.measure_texels`.

    Args:
        moment: default: the session's present moment.
        view: id of a photo; default: each sample has the mean over the photos that show it.

    Raises:
        IndexError: no such moment or photo.
        InputError: no photo sees any face well enough.
        Cancelled: the session's cancellation was requested.
    """
    moment = chosen_moment(session, moment, view)

    def by_sample(cells: FaceCells) -> np.ndarray:
        return _by_sample(cells, slice(None) if view is None else cells.views == view)

    return measure_texels(TexelResiduals, session, moment, view, "measuring residuals", by_sample)


def _by_sample(cells: FaceCells, chosen: np.ndarray | slice) -> np.ndarray:
    """(p,) float32: |e| of each sample over the chosen cells that show it; NaN where none does."""
    residual, counts = np.abs(cells.residual[chosen]), cells.counts[chosen]
    total, count = (
        each.reshape(-1, len(cells.rows_and_columns[0])).sum(axis=0) for each in (np.where(counts, residual, 0), counts)
    )
    return np.divide(total, count, out=np.full(total.shape, np.nan, dtype=np.float32), where=count > 0)
