"""Series: quantities over the moments of a record, and their reduction to the points that a plot can show."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from app.debugger.history import Recorded
from app.debugger.step_text import slot_of
from fairing.trace import StepReason, StepRecord

NAN = float("nan")
RESIDUAL = "residual"
"""The comparable residual; `app.debugger.residual_history` knows its values."""


@dataclass(frozen=True)
class Quantity:
    """A number for each step, of the run or of one vertex.

    Attributes:
        title: label.
        meaning: with its unit.
        run_caption, vertex_caption: the same for the run and for one vertex, each short enough for the line above a plot.
        is_log: whether its scale is logarithmic by default.
        of_run: computes it for all vertices of a step.
        of_vertex: computes it for one vertex, given its index in the record and the faces of its one-ring.
    """

    title: str
    meaning: str
    run_caption: str
    vertex_caption: str
    is_log: bool
    of_run: Callable[[StepRecord], float]
    of_vertex: Callable[[StepRecord, int, np.ndarray], float]


def _energy_around(record: StepRecord, slot: int, ring: np.ndarray) -> float:
    around = np.isin(record.faces, ring)
    return float(record.face_energy_after[around].sum()) if around.any() else NAN


def _ratio(eigenvalues: np.ndarray) -> float:
    """The smallest ratio of smallest to largest eigenvalue among (u, 3), ascending; NaN if none is known."""
    known = eigenvalues[eigenvalues[:, 2] > 0]
    return float((known[:, 0] / known[:, 2]).min()) if len(known) else NAN


def _rejected(reasons: np.ndarray) -> float:
    return float(np.isin(reasons, [StepReason.REJECTED_ENERGY, StepReason.REJECTED_FOLD]).sum())


QUANTITIES: dict[str, Quantity] = {
    "step": Quantity(
        "step", "longest step tried, px in a photo", "Longest step tried, px in a photo", "Step tried, px in a photo", True,
        lambda record: float(record.step_px.max(initial=0)), lambda record, slot, ring: float(record.step_px[slot]),
    ),
    "damping": Quantity(
        "damping", "largest Levenberg-Marquardt damping, relative to the normal matrix's largest eigenvalue",
        "Largest damping among the vertices", "Damping of the vertex", True,
        lambda record: float(record.damping.max(initial=0)), lambda record, slot, ring: float(record.damping[slot]),
    ),
    "eigen": Quantity(
        "certainty", "smallest ratio of smallest to largest eigenvalue of a vertex's normal matrix",
        "Lowest eigenvalue ratio, smallest : largest", "Eigenvalue ratio, smallest : largest", True,
        lambda record: _ratio(record.eigenvalues),
        lambda record, slot, ring: _ratio(record.eigenvalues[slot : slot + 1]),
    ),
    "rejected": Quantity(
        "rejected", "vertices whose step was rejected; for a vertex: consecutive rejections",
        "Vertices whose step was rejected", "Rejections in a row", False,
        lambda record: _rejected(record.reasons), lambda record, slot, ring: float(record.rejections[slot]),
    ),
    "energy": Quantity(
        "sweep energy",
        "what the steps of a sweep minimize (expert's view); for a vertex: of the faces around it. Every sweep of every level "
        "measures anew, with cells, blur and robust scale of its own, so only points connected by a line compare",
        "Expert: only connected points compare", "Expert: energy of the faces around the vertex", False,
        lambda record: record.energy_after, _energy_around,
    ),
}  # fmt: skip


class Series:
    """The values of a quantity at the steps where it is defined. Reads new steps only."""

    def __init__(self, measure: Callable[[StepRecord, int], float | None]) -> None:
        self._measure = measure
        self._clear(-1)

    def _clear(self, run_id: int) -> None:
        self._run_id, self._known = run_id, 0
        self._moments: list[int] = []
        self._values: list[float] = []

    def update(self, run: Recorded) -> None:
        """Read the new steps; start again for another run."""
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
        """(n,) int, ascending: the moments after the steps."""
        return np.array(self._moments, dtype=int)

    @property
    def values(self) -> np.ndarray:
        """(n,) float."""
        return np.array(self._values, dtype=float)

    def at(self, moment: int) -> float:
        """The value of the last step up to a moment that has one; NaN before the first."""
        index = int(np.searchsorted(self.moments, moment, side="right"))
        return self._values[index - 1] if index else NAN


def series_of(name: str, vertex: int | None, ring: np.ndarray) -> Series:
    """A quantity of the run, or of a vertex with the one-ring `ring`, (f,) int face ids."""
    quantity = QUANTITIES[name]
    if vertex is None:
        return Series(lambda record, moment: quantity.of_run(record))

    def measure(record: StepRecord, moment: int) -> float | None:
        slot = slot_of(record, vertex)
        return None if slot is None else quantity.of_vertex(record, slot, ring)

    return Series(measure)


def thinned(places: np.ndarray, values: np.ndarray, pixels: int) -> np.ndarray:
    """Indices (k,) int of the points that a plot of this width can show: the lowest and highest of every pixel column.

    Args:
        places: (n,) float, ascending.
        values: (n,) float.
        pixels: width of the plot.
    """
    count = len(places)
    if count <= 2 * pixels:
        return np.arange(count)
    span = float(places[-1] - places[0]) or 1.0
    pixel = np.minimum(((places - places[0]) / span * pixels).astype(int), pixels - 1)
    # Sorted by pixel, then value: the extremes of a pixel are the ends of its group.
    order = np.lexsort((values, pixel))
    begins = np.flatnonzero(np.diff(pixel[order], prepend=-1))
    ends = np.append(begins[1:], count) - 1
    return np.unique(np.concatenate([[0, count - 1], order[begins], order[ends]]))
