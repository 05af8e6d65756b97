"""Error history: the distance of the mesh to the known truth at every moment of a record."""

import threading
from collections.abc import Collection

import numpy as np

from app.debugger.history import Recorded
from fairing.judge.metrics import determined_part
from fairing.scene import Scene


def knows_truth(scene: Scene) -> bool:
    """Whether the true position of every vertex is known."""
    return scene.truth is not None and scene.truth.vertices is not None


class ErrorMeasure:
    """Errors of single vertices: the distance to the truth along directions that photos can determine.

    Args:
        scene: see `knows_truth`.
    """

    def __init__(self, scene: Scene) -> None:
        assert scene.truth is not None
        assert scene.truth.vertices is not None
        self._truth, self._diagonal = scene.truth.vertices, scene.mesh.diagonal
        # Column k of a vertex's projection is the determined part of the unit vector k.
        units = [determined_part(scene, np.tile(unit, (len(self._truth), 1))) for unit in np.eye(3)]
        self._projections = np.stack(units, axis=2)

    def percent(self, vertices: np.ndarray, positions: np.ndarray) -> np.ndarray:
        """(u,) float, percent of the diagonal: errors of vertices (u,) int at positions (u, 3), world units."""
        error = positions - self._truth[vertices]
        part = np.einsum("vij,vj->vi", self._projections[vertices], error)
        return 100 * np.linalg.norm(part, axis=1) / self._diagonal


class ErrorHistory:
    """Root mean square of the vertices' errors at every moment. Reads new steps only."""

    def __init__(self, measure: ErrorMeasure) -> None:
        self._measure = measure
        self._run_id = -1
        self._squares = np.zeros(0)
        self._values: list[float] = []

    def update(self, run: Recorded) -> None:
        """Read the new steps; start again for another run."""
        if run.run_id != self._run_id:
            self._run_id = run.run_id
            every = np.arange(len(run.trace.start))
            self._squares = self._measure.percent(every, run.trace.start) ** 2
            self._values = [float(np.sqrt(self._squares.mean()))]
        for record in run.trace.steps[len(self._values) - 1 : run.length]:
            self._squares[record.vertices] = self._measure.percent(record.vertices, record.after) ** 2
            self._values.append(float(np.sqrt(self._squares.mean())))

    @property
    def values(self) -> np.ndarray:
        """(moments,) float, percent of the diagonal: the first is that of the start."""
        return np.array(self._values)


class RunErrors:
    """The error histories of all runs, shared by all pages. Safe to use from several threads."""

    def __init__(self, scene: Scene) -> None:
        self.measure = ErrorMeasure(scene)
        self._histories: dict[int, ErrorHistory] = {}
        self._lock = threading.Lock()

    def values_of(self, run: Recorded) -> np.ndarray:
        """(moments,) float, percent of the diagonal: the errors of a run at its start and after its steps."""
        with self._lock:
            history = self._histories.setdefault(run.run_id, ErrorHistory(self.measure))
            history.update(run)
            return history.values[: run.length + 1]

    def keep(self, run_ids: Collection[int]) -> None:
        """Forget all other runs."""
        with self._lock:
            self._histories = {run_id: history for run_id, history in self._histories.items() if run_id in run_ids}
