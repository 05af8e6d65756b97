"""Background worker: runs computations on its own thread and passes each result to a callback."""

import logging
import threading
from collections.abc import Callable, Hashable
from typing import Any, NamedTuple

from app.worker_thread import WorkerThread


class _Job(NamedTuple):
    compute: Callable[[], Any]
    callback: Callable[[Any], None]


class BackgroundWorker:
    """Runs jobs in the order they were posted. A job replaces one with the same key that has not begun.

    Args:
        on_done: called after every job, on the worker's thread.
        name: of the thread.
    """

    def __init__(self, on_done: Callable[[], None] = lambda: None, name: str = "background") -> None:
        self._on_done = on_done
        self._jobs: dict[Hashable, _Job] = {}
        self._changed = threading.Condition()
        self._thread = WorkerThread(name, self._changed, self._take, self._run)
        self._thread.start()

    def post(self, key: Hashable, compute: Callable[[], Any], callback: Callable[[Any], None]) -> None:
        """Run `compute` later and pass its result, or the exception it raised, to `callback` on the worker's thread."""
        if self._thread.is_dead:
            self._thread.restart()
        with self._changed:
            self._jobs.pop(key, None)
            self._jobs[key] = _Job(compute, callback)
            self._changed.notify_all()

    def cancel(self, key: Hashable) -> None:
        """Drop the job with this key unless it has begun."""
        with self._changed:
            self._jobs.pop(key, None)

    def close(self, timeout: float = 10.0) -> None:
        """Drop the waiting jobs and wait at most `timeout` seconds for the job in progress."""
        self._thread.close(timeout)

    def _take(self) -> _Job | None:
        return self._jobs.pop(next(iter(self._jobs))) if self._jobs else None

    def _run(self, job: _Job) -> None:
        try:
            result: Any = job.compute()
        except Exception as error:
            result = error
        try:
            job.callback(result)
        except Exception:
            logging.getLogger(__name__).exception("the callback of a background computation failed")
        else:
            self._on_done()
