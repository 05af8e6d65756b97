"""Quantities over the moments of a record, gathered once a step, and few enough points of them to draw."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from app.debugger.history import Recorded
from app.debugger.step_text import slot_of
from fairing.trace import StepReason, StepRecord

NAN = float("nan")


@dataclass(frozen=True)
class Quantity:
    """One number a step, of the run or of one vertex.

    Attributes:
        title: what a chip says.
        meaning: with its unit.
        is_log: whether it spans powers of ten.
        of_run: of all vertices of a step.
        of_vertex: of the vertex at a slot of a step; its one-ring's faces are given, too.
    """

    title: str
    meaning: str
    is_log: bool
    of_run: Callable[[StepRecord], float]
    of_vertex: Callable[[StepRecord, int, np.ndarray], float]


def _energy_around(record: StepRecord, slot: int, ring: np.ndarray) -> float:
    return float(record.face_energy_after[np.isin(record.faces, ring)].sum())


def _ratio(eigenvalues: np.ndarray) -> float:
    """The smallest ratio of weakest to strongest among (u, 3)."""
    known = eigenvalues[eigenvalues[:, 2] > 0]
    return float((known[:, 0] / known[:, 2]).min()) if len(known) else NAN


def _rejected(reasons: np.ndarray) -> float:
    return float(np.isin(reasons, [StepReason.REJECTED_ENERGY, StepReason.REJECTED_FOLD]).sum())


QUANTITIES: dict[str, Quantity] = {
    "energy": Quantity(
        "energy", "energy; of a vertex: of the faces around it", False,
        lambda record: record.energy_after, _energy_around,
    ),
    "step": Quantity(
        "step", "longest step tried, px in a photo", True,
        lambda record: float(record.step_px.max(initial=0)), lambda record, slot, ring: float(record.step_px[slot]),
    ),
    "damping": Quantity(
        "damping", "largest Levenberg-Marquardt damping, relative to the normal matrix's diagonal", True,
        lambda record: float(record.damping.max(initial=0)), lambda record, slot, ring: float(record.damping[slot]),
    ),
    "eigen": Quantity(
        "eigen", "smallest ratio of weakest to strongest eigenvalue of a vertex' normal matrix", True,
        lambda record: _ratio(record.eigenvalues),
        lambda record, slot, ring: _ratio(record.eigenvalues[slot : slot + 1]),
    ),
    "rejected": Quantity(
        "rejected", "vertices whose step was rejected; of a vertex: rejections in a row", False,
        lambda record: _rejected(record.reasons), lambda record, slot, ring: float(record.rejections[slot]),
    ),
}  # fmt: skip


class Series:
    """A number for every step it is known for. Reads new steps only."""

    def __init__(self, measure: Callable[[StepRecord, int], float | None]) -> None:
        self._measure = measure
        self._clear(-1)

    def _clear(self, run_id: int) -> None:
        self._run_id, self._known = run_id, 0
        self._moments: list[int] = []
        self._values: list[float] = []

    def update(self, run: Recorded) -> None:
        """Take in the steps that are new; begin again with another run."""
        if run.run_id != self._run_id:
            self._clear(run.run_id)
        for moment in range(self._known + 1, run.length + 1):
            value = self._measure(run.trace.steps[moment - 1], moment)
            if value is not None and np.isfinite(value):
                self._moments.append(moment)
                self._values.append(value)
        self._known = max(self._known, run.length)

    @property
    def moments(self) -> np.ndarray:
        """(n,) int, ascending: the moments the steps led to."""
        return np.array(self._moments, dtype=int)

    @property
    def values(self) -> np.ndarray:
        """(n,) float."""
        return np.array(self._values, dtype=float)

    def at(self, moment: int) -> float:
        """The value at a moment: of the last step up to it that has one; not a number before the first."""
        index = int(np.searchsorted(self.moments, moment, side="right"))
        return self._values[index - 1] if index else NAN


def series_of(name: str, vertex: int | None, ring: np.ndarray) -> Series:
    """A quantity of the run, or of a vertex with the faces `ring` around it."""
    quantity = QUANTITIES[name]
    if vertex is None:
        return Series(lambda record, moment: quantity.of_run(record))

    def measure(record: StepRecord, moment: int) -> float | None:
        slot = slot_of(record, vertex)
        return None if slot is None else quantity.of_vertex(record, slot, ring)

    return Series(measure)


def thinned(places: np.ndarray, values: np.ndarray, pixels: int) -> np.ndarray:
    """Indices of the points that a line of so many pixels can show: of every pixel the lowest and the highest.

    Args:
        places: (n,) ascending.
        values: (n,).
    """
    count = len(places)
    if count <= 2 * pixels:
        return np.arange(count)
    span = float(places[-1] - places[0]) or 1.0
    pixel = np.minimum(((places - places[0]) / span * pixels).astype(int), pixels - 1)
    # Sorted by pixel, then value: the ends of every group are its extremes.
    order = np.lexsort((values, pixel))
    begins = np.flatnonzero(np.diff(pixel[order], prepend=-1))
    ends = np.append(begins[1:], count) - 1
    return np.unique(np.concatenate([[0, count - 1], order[begins], order[ends]]))
