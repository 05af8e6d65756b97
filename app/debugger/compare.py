"""Two moments side by side: a reference, called A, and now. Either may be of any run that is kept."""

from dataclasses import dataclass

import numpy as np

from app.debugger.history import EnergyHistory
from app.debugger.moment_id import moment_id
from app.debugger.run_state import RunState
from app.debugger.runs import RunInfo


@dataclass(frozen=True)
class Reference:
    """What somebody chose to compare with.

    Attributes:
        run_id: of which run.
        moment: of it; None: wherever that run stands.
    """

    run_id: int
    moment: int | None = None


@dataclass(frozen=True, eq=False)
class Compared:
    """A reference that was looked up.

    Attributes:
        run: it belongs to.
        moment: of that run.
        vertices: (n, 3) float, positions there, world units.
    """

    run: RunInfo
    moment: int
    vertices: np.ndarray

    @property
    def name(self) -> str:
        return f"{self.run.name} at {id_in_run(self.run, self.moment)}"


def look_up(reference: Reference | None, state: RunState) -> Compared | None:
    """The reference's mesh; None if none is chosen or its run is gone."""
    found = [run for run in state.runs if reference is not None and run.run_id == reference.run_id]
    if reference is None or not found:
        return None
    run = found[0]
    if reference.moment is None or reference.moment == run.moment:
        return Compared(run, run.moment, run.vertices)
    moment = min(reference.moment, run.length)
    return Compared(run, moment, run.trace.vertices_at(moment))


def id_in_run(run: RunInfo, moment: int) -> str:
    """The id of a recorded moment of a run."""
    if moment == 0:
        return "start"
    return moment_id(run.trace.steps[moment - 1].next_position, moment, run.options.n_levels)


def distances(compared: Compared, vertices: np.ndarray) -> np.ndarray:
    """(n,) float: how far each vertex is from where it is in the reference, world units."""
    return np.linalg.norm(vertices - compared.vertices, axis=1)


class RunEnergies:
    """The energies of every run, gathered once for all pages. Reads new steps only."""

    def __init__(self, n_faces: int) -> None:
        self._n_faces = n_faces
        self._histories: dict[int, EnergyHistory] = {}

    def of(self, run: RunInfo) -> EnergyHistory:
        """The history of a run, up to date."""
        history = self._histories.setdefault(run.run_id, EnergyHistory(self._n_faces))
        history.update(run)
        return history
