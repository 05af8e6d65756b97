"""Compile watch: which function numba compiles in this process at present."""

import time
from typing import Any

from numba.core import event

from app.debugger.work_report import WorkReport

NOTICEABLE = 0.5  # s


class _Watch(event.Listener):
    def __init__(self) -> None:
        self.depth, self.count, self.began = 0, 0, 0.0

    def on_start(self, event: Any) -> None:
        if self.depth == 0:
            self.began = time.monotonic()
        self.depth += 1
        self.count += 1

    def on_end(self, event: Any) -> None:
        self.depth -= 1


_watch = _Watch()
event.register("numba:compile", _watch)


def compiling() -> WorkReport | None:
    """The report of a compilation in progress that takes noticeable time; None without one."""
    seconds = time.monotonic() - _watch.began
    if _watch.depth <= 0 or seconds < NOTICEABLE:
        return None
    return WorkReport(f"compiling, first use only: {_watch.count} functions so far", seconds=round(seconds))
