"""The page's experiments: one at a time, beside the run and without touching it; the last of each kind is kept.

Nothing in here knows of a browser.
"""

import logging
import os
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from enum import Enum

from app.experiments.record import Record
from app.experiments.workers import measure_all
from fairing.errors import InputError
from fairing.experiments import EXPERIMENTS, Experiment, Row, Setting, check_truth
from fairing.options import FairingOptions
from fairing.scene import Scene

MOST_WORKERS = 4  # they give way to the debugger, which is less nice


class Status(Enum):
    """What became of an experiment."""

    WORKING = "working"
    DONE = "done"
    CANCELLED = "cancelled"
    FAILED = "failed"


@dataclass(frozen=True, eq=False)
class Outcome:
    """Attributes:
    experiment: with how much it does.
    setting: scene, vertex and options.
    record: None until the cases are known.
    rows: what has been measured, in the order it came.
    problem: why it failed, one line.
    seconds: since it began, or until it ended.
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
        """Seconds until the end, as far as can be told."""
        if self.record is None or not self.rows:
            return None
        return self.seconds / len(self.rows) * (len(self.record.cases) - len(self.rows))


class ExperimentRunner:
    """Starts and cancels experiments on the scene at hand, in processes of their own.

    Args:
        source: what the user typed for the scene.
        on_change: called after every result; on any thread.
    """

    def __init__(self, scene: Scene, source: str, on_change: Callable[[], None]) -> None:
        self._scene, self._source, self._on_change = scene, source, on_change
        self._outcomes: dict[str, Outcome] = {}
        self._lock = threading.Lock()
        self._unwanted = threading.Event()
        self._thread: threading.Thread | None = None

    @property
    def working(self) -> str | None:
        """The name of the experiment at work."""
        return next((name for name, found in self._outcomes.items() if found.status is Status.WORKING), None)

    def outcome(self, name: str) -> Outcome | None:
        """The newest of this kind."""
        return self._outcomes.get(name)

    def obstacle(self) -> str:
        """Why no experiment can be made on this scene; empty if one can."""
        try:
            check_truth(self._scene)
        except InputError as error:
            return str(error)
        return ""

    def start(self, experiment: Experiment, options: FairingOptions, vertex: int | None = None) -> None:
        """Begin, and return at once.

        Args:
            options: of every run, but for what the experiment varies.
            vertex: the one that is put off its place; default: the one that photos see best.

        Raises:
            InputError: another is at work, or the scene does not allow it.
        """
        setting = Setting.of(self._scene, options, vertex)
        with self._lock:
            busy = self.working
            if busy is not None:
                raise InputError(f"{EXPERIMENTS[busy].title} is at work; wait for its end or cancel it")
            self._outcomes[experiment.name] = Outcome(experiment, setting)
        self._unwanted.clear()
        self._thread = threading.Thread(target=self._run, args=(experiment.name,), name="experiment", daemon=True)
        self._thread.start()
        self._on_change()

    def cancel(self) -> None:
        """Drop the cases in hand; what has been measured stays."""
        self._unwanted.set()

    def close(self) -> None:
        """Cancel and wait until its processes have gone."""
        self.cancel()
        if self._thread is not None:
            self._thread.join(timeout=10)

    def _run(self, name: str) -> None:
        started = self._outcomes[name]
        experiment, setting = started.experiment, started.setting
        status, problem = Status.FAILED, ""
        try:
            cases = experiment.cases(setting)
            self._change(name, record=Record(experiment, setting, self._source, cases))
            workers = min(os.cpu_count() or 1, MOST_WORKERS)
            is_whole = measure_all(experiment, setting, cases, workers, self._take(name), self._unwanted.is_set)
            status = Status.DONE if is_whole else Status.CANCELLED
        except InputError as error:
            problem = str(error)
        except Exception as error:  # whatever happens here, the page lives on
            logging.getLogger(__name__).exception("an experiment failed")
            problem = f"{type(error).__name__}: {error}"
        self._change(name, status=status, problem=problem)

    def _take(self, name: str) -> Callable[[Row], None]:
        return lambda row: self._change(name, rows=(*self._outcomes[name].rows, row))

    def _change(self, name: str, **changes: object) -> None:
        outcome = self._outcomes[name]
        self._outcomes[name] = replace(outcome, seconds=time.monotonic() - outcome.began, **changes)  # pyright: ignore[reportArgumentType]
        self._on_change()
