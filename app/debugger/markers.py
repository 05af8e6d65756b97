"""Markers: the breakpoints and bookmarks that all pages share, and the log of breakpoints that only report."""

import threading
from collections import deque
from collections.abc import Callable

import numpy as np

from app.debugger.bookmarks import Bookmarks
from app.debugger.breakpoints import Breakpoints
from app.debugger.quantities import StepContext
from fairing.run.session import Session

LOG_LINES = 50


class Markers:
    """Edited by any thread, checked by the engine thread.

    Args:
        lock: held while they are replaced; not held while conditions are evaluated, which may take long.
    """

    def __init__(self, lock: threading.Condition, bookmarks: Bookmarks) -> None:
        self._lock = lock
        self.breakpoints, self.bookmarks = Breakpoints(), bookmarks
        self._log: deque[str] = deque(maxlen=LOG_LINES)

    @property
    def log(self) -> tuple[str, ...]:
        """Hits of breakpoints that only report, the newest last."""
        return tuple(self._log)

    def edit_breakpoints(self, edit: Callable[[Breakpoints], Breakpoints]) -> None:
        with self._lock:
            self.breakpoints = edit(self.breakpoints)

    def edit_bookmarks(self, edit: Callable[[Bookmarks], Bookmarks]) -> None:
        with self._lock:
            self.bookmarks = edit(self.bookmarks)

    def check(self, session: Session, stopped: np.ndarray) -> str:
        """Count the breakpoints that hold after the step just made; returns the reason to stop, empty to continue.

        Args:
            stopped: (n, 3) float, the vertices when the run last stopped, world units.
        """
        moment = session.moment
        before = self.breakpoints
        after, hit = before.checked(session.trace.steps[moment - 1], moment, StepContext(session, stopped))
        with self._lock:
            if self.breakpoints is before:
                self.breakpoints = after
        for item in hit:
            if item.logs:
                self._log.append(f"moment {moment}: {item.condition.text}")
        stops = [item.condition.text for item in hit if not item.logs]
        return f"breakpoint: {', '.join(stops)}" if stops else ""
