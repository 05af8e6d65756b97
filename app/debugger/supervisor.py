"""Supervisor: notices worker threads that have died or do not respond, and has them replaced."""

import logging
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

from app.worker_thread import WorkerThread

PERIOD = 0.25  # s between two checks


@dataclass(frozen=True)
class Watched:
    """A thread under supervision.

    Attributes:
        worker: the thread.
        unresponsive_seconds: returns for how long it has not responded to what it must respond to, s.
        limit: seconds after which it counts as stuck.
        recover: called with "dead" or "stuck" and the traceback or call stack; must replace the thread.
    """

    worker: WorkerThread
    unresponsive_seconds: Callable[[], float]
    limit: float
    recover: Callable[[Literal["dead", "stuck"], str], None]


class Supervisor:
    """Checks threads periodically on its own thread."""

    def __init__(self, watched: Sequence[Watched], period: float = PERIOD) -> None:
        self._watched, self._period = watched, period
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="supervisor", daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._closing.set()
        self._thread.join(timeout=5)

    def _run(self) -> None:
        while not self._closing.wait(self._period):
            for watched in self._watched:
                try:
                    _check(watched)
                except BaseException:
                    logging.getLogger(__name__).exception("the %s thread could not be replaced", watched.worker.name)


def _check(watched: Watched) -> None:
    worker = watched.worker
    if worker.is_dead:
        watched.recover("dead", worker.failure)
    elif watched.unresponsive_seconds() > watched.limit:
        watched.recover("stuck", worker.stack())
