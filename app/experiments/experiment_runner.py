"""Experiment runner: runs experiments for the page, one at a time and independent of the run; keeps the last of each kind.

Independent of the browser.
"""

import logging
import os
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from enum import Enum

from app.background_worker import BackgroundWorker
from app.experiments.record import Record
from app.experiments.workers import measure_all
from fairing.errors import InputError
from fairing.experiments import Experiment, Row, Setting, check_truth, experiments
from fairing.options import FairingOptions
from fairing.scene import Scene

MAX_PROCESSES = 4  # with lower priority than the debugger


class Status(Enum):
    """Status of an experiment."""

    WORKING = "working"
    DONE = "done"
    CANCELLED = "cancelled"
    FAILED = "failed"


@dataclass(frozen=True, eq=False)
class Outcome:
    """State and results of an experiment.

    Attributes:
        experiment: with its parameters.
        setting: scene, vertex and options.
        record: None until the cases are known.
        rows: the measured cases, in the order of completion.
        problem: why it failed, one line.
        seconds: since it began, or until it ended.
        began: value of the monotonic clock at its beginning, s.
    """

    experiment: Experiment
    setting: Setting
    status: Status = Status.WORKING
    record: Record | None = None
    rows: tuple[Row, ...] = ()
    problem: str = ""
    seconds: float = 0.0
    began: float = field(default_factory=time.monotonic)

    @property
    def left(self) -> float | None:
        """Estimated seconds until the end; None before the first result."""
        if self.record is None or not self.rows:
            return None
        return self.seconds / len(self.rows) * (len(self.record.cases) - len(self.rows))


class ExperimentRunner:
    """Starts and cancels experiments on a scene, in separate processes.

    Args:
        source: the scene as the user named it.
        on_change: called after every result, on any thread.
    """

    def __init__(self, scene: Scene, source: str, on_change: Callable[[], None]) -> None:
        self._scene, self._source, self._on_change = scene, source, on_change
        self._outcomes: dict[str, Outcome] = {}
        self._lock = threading.Lock()
        self._cancelled = threading.Event()
        self._worker = BackgroundWorker(name="experiment")

    @property
    def working(self) -> str | None:
        """The name of the running experiment; None if none is running."""
        return next((name for name, found in self._outcomes.items() if found.status is Status.WORKING), None)

    def outcome(self, name: str) -> Outcome | None:
        """The last outcome of this kind of experiment; None if there is none."""
        return self._outcomes.get(name)

    def obstacle(self) -> str:
        """Why no experiment is possible on this scene; empty if they are possible."""
        try:
            check_truth(self._scene)
        except InputError as error:
            return str(error)
        return ""

    def start(self, experiment: Experiment, options: FairingOptions, vertex: int | None = None) -> None:
        """Start an experiment and return at once.

        Args:
            options: of every run, except those that the experiment varies.
            vertex: the vertex to displace; default: the one that the photos see best.

        Raises:
            InputError: another experiment is running, or the scene does not allow it.
        """
        setting = Setting.of(self._scene, options, vertex)
        with self._lock:
            busy = self.working
            if busy is not None:
                raise InputError(f"{experiments()[busy].title} is running; wait for its end or cancel it")
            self._outcomes[experiment.name] = Outcome(experiment, setting)
        self._cancelled.clear()
        self._worker.post(self, lambda: self._run(experiment.name), lambda _: None)
        self._on_change()

    def cancel(self) -> None:
        """Cancel the cases in progress; the measured ones are kept."""
        self._cancelled.set()

    def close(self) -> None:
        """Cancel and wait until the processes have ended."""
        self.cancel()
        self._worker.close()

    def _run(self, name: str) -> None:
        started = self._outcomes[name]
        experiment, setting = started.experiment, started.setting
        status, problem = Status.FAILED, ""
        try:
            cases = experiment.cases(setting)
            self._change(name, record=Record(experiment, setting, self._source, cases))
            workers = min(os.cpu_count() or 1, MAX_PROCESSES)
            is_whole = measure_all(experiment, setting, cases, workers, self._add_row(name), self._cancelled.is_set)
            status = Status.DONE if is_whole else Status.CANCELLED
        except InputError as error:
            problem = str(error)
        except Exception as error:
            logging.getLogger(__name__).exception("an experiment failed")
            problem = f"{type(error).__name__}: {error}"
        self._change(name, status=status, problem=problem)

    def _add_row(self, name: str) -> Callable[[Row], None]:
        return lambda row: self._change(name, rows=(*self._outcomes[name].rows, row))

    def _change(self, name: str, **changes: object) -> None:
        outcome = self._outcomes[name]
        self._outcomes[name] = replace(outcome, seconds=time.monotonic() - outcome.began, **changes)  # pyright: ignore[reportArgumentType]
        self._on_change()
