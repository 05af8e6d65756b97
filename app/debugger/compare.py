"""Comparison: a reference moment of any run against the present moment."""

import threading
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from app.debugger.history import EnergyCurves, EnergyHistory, Recorded
from app.debugger.moment_id import moment_id
from app.debugger.run_state import RunState
from app.debugger.runs import RunInfo


@dataclass(frozen=True)
class Reference:
    """A moment chosen for comparison.

    Attributes:
        run_id: the run.
        moment: of that run; None: its last recorded moment, which the table of runs describes.
    """

    run_id: int
    moment: int | None = None


@dataclass(frozen=True, eq=False)
class Compared:
    """A reference with its mesh.

    Attributes:
        run: the run.
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
    """The mesh of a reference; None without a reference, or if its run was deleted."""
    found = [run for run in state.runs if reference is not None and run.run_id == reference.run_id]
    if reference is None or not found:
        return None
    run = found[0]
    moment = run.length if reference.moment is None else min(reference.moment, run.length)
    if moment == run.moment:
        return Compared(run, run.moment, run.vertices)
    return Compared(run, moment, run.trace.vertices_at(moment))


def id_in_run(run: RunInfo, moment: int) -> str:
    """The id of a recorded moment of a run."""
    if moment == 0:
        return "start"
    return moment_id(run.trace.steps[moment - 1].next_position, moment, run.options.n_levels)


def distances(compared: Compared, vertices: np.ndarray) -> np.ndarray:
    """(n,) float: distance of each vertex from its position in the reference, world units."""
    return np.linalg.norm(vertices - compared.vertices, axis=1)


class RunEnergies:
    """The energy histories of all runs, shared by all pages. Safe to use from several threads."""

    def __init__(self, n_faces: int) -> None:
        self._n_faces = n_faces
        self._histories: dict[int, EnergyHistory] = {}
        self._lock = threading.Lock()

    def of(self, run: Recorded) -> EnergyHistory:
        """The up-to-date history of a run."""
        found = FollowedEnergies(self, self._n_faces)
        found.update(run)
        return found

    def curves_of(self, run: Recorded) -> EnergyCurves:
        """The energies of a run's first `run.length` steps."""
        with self._lock:
            history = self._histories.setdefault(run.run_id, EnergyHistory(self._n_faces))
            history.update(run)
            return EnergyCurves(*(curve[: run.length] for curve in history.curves))

    def keep(self, run_ids: Collection[int]) -> None:
        """Forget all other runs."""
        with self._lock:
            self._histories = {run_id: history for run_id, history in self._histories.items() if run_id in run_ids}


class FollowedEnergies(EnergyHistory):
    """The history of the run of the latest `update`; `RunEnergies` reads every step once for all pages."""

    def __init__(self, shared: RunEnergies, n_faces: int) -> None:
        super().__init__(n_faces)
        self._shared = shared

    def update(self, state: Recorded) -> None:
        self.curves = self._shared.curves_of(state)
