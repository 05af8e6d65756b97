"""Page updates: the newest state is delivered to a page on a thread of its own."""

import threading
from collections.abc import Callable

from app.debugger.run_state import RunState
from app.worker_thread import WorkerThread

STUCK_SECONDS = 60.0  # a page that takes longer gets another thread


class PageUpdates:
    """Delivers states to one page. Only the newest waits, so a page that blocks or is slow neither delays others nor fills
    the memory.

    Args:
        show: brings the page up to date.
        stuck_seconds: a delivery that takes longer is given up, and the next one begins on a new thread.
    """

    def __init__(self, show: Callable[[RunState], None], stuck_seconds: float = STUCK_SECONDS) -> None:
        self._changed = threading.Condition()
        self._newest: RunState | None = None
        self._stuck_seconds = stuck_seconds
        self._worker: WorkerThread[RunState] = WorkerThread("page", self._changed, self._take, show)
        self._worker.start()

    def put(self, state: RunState) -> None:
        """Deliver this state unless a newer one comes first. Returns at once."""
        with self._changed:
            if self._worker.is_dead or self._worker.busy_seconds > self._stuck_seconds:
                self._worker.restart()
            self._newest = state
            self._changed.notify_all()

    def close(self) -> None:
        """Deliver nothing more. A delivery in progress is not waited for."""
        self._worker.close(timeout=0)

    def _take(self) -> RunState | None:
        state, self._newest = self._newest, None
        return state
