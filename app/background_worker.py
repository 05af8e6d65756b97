"""Slow drawing on a thread of its own, so that neither the engine nor the pages wait for it."""

import logging
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class _Job:
    work: Callable[[], Any]
    answer: Callable[[Any], None]


class Background:
    """Works off jobs one after another; a newer job of the same asker replaces one that has not begun.

    Args:
        on_done: called after every job.
    """

    def __init__(self, on_done: Callable[[], None]) -> None:
        self._on_done = on_done
        self._jobs: dict[object, _Job] = {}
        self._changed = threading.Condition()
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="background", daemon=True)
        self._thread.start()

    def post(self, asker: object, work: Callable[[], Any], answer: Callable[[Any], None]) -> None:
        """Have `work` done; `answer` is told its result, or what it raised, on the background's thread."""
        with self._changed:
            self._jobs.pop(asker, None)
            self._jobs[asker] = _Job(work, answer)
            self._changed.notify_all()

    def close(self) -> None:
        """Finish the job in hand and forget the others."""
        with self._changed:
            self._closing = True
            self._changed.notify_all()
        self._thread.join(timeout=10)

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._closing or self._jobs)
                if self._closing:
                    return
                asker = next(iter(self._jobs))
                job = self._jobs.pop(asker)
            try:
                result: Any = job.work()
            except Exception as error:
                result = error
            try:
                job.answer(result)
                self._on_done()
            except Exception:  # the asker's trouble is not the next one's
                logging.getLogger(__name__).exception("an answer could not be taken")
