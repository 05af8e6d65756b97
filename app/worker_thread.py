"""Worker thread: handles items one after another, survives their exceptions, and can be replaced when it is dead or stuck."""

import logging
import threading
import time
import traceback
from collections.abc import Callable
from typing import Generic, TypeVar

T = TypeVar("T")

log = logging.getLogger(__name__)


class WorkerThread(Generic[T]):
    """A daemon thread that takes items and handles them.

    An `Exception` that `handle` raises is logged, and the thread takes the next item. Anything else that escapes
    (`SystemExit`, or an exception in `take`) ends the thread; `failure` then holds the traceback until `restart`.

    Args:
        name: of the thread.
        changed: guards what `take` reads. Whoever adds an item calls `changed.notify_all()`.
        take: returns the next item, or None if there is none. Called with `changed` held, so it must be quick.
        handle: processes an item. Called without any lock held.
        poll: seconds after which `take` is called again without a notification; None: never.
    """

    def __init__(
        self,
        name: str,
        changed: threading.Condition,
        take: Callable[[], T | None],
        handle: Callable[[T], None],
        poll: float | None = None,
    ) -> None:
        self.name, self._changed, self._take, self._handle, self._poll = name, changed, take, handle, poll
        self._is_closing = False
        self._busy_since: float | None = None
        self.failure = ""
        """The traceback of the exception that ended the thread; empty while it lives."""
        self._thread = self._new_thread()

    def start(self) -> None:
        """Start the thread; call once."""
        self._thread.start()

    @property
    def is_alive(self) -> bool:
        return self._thread.is_alive()

    @property
    def is_dead(self) -> bool:
        """Whether the thread has ended although `close` was not called."""
        return not self._is_closing and self._thread.ident is not None and not self._thread.is_alive()

    @property
    def is_current(self) -> bool:
        """Whether the calling thread is this worker's; False on a thread that `restart` has replaced."""
        return threading.current_thread() is self._thread

    @property
    def busy_seconds(self) -> float:
        """Time since the item in progress was taken; 0 between items."""
        since = self._busy_since
        return 0.0 if since is None else time.monotonic() - since

    def stack(self) -> str:
        """The call stack of the thread at present, for a report; empty if it has ended."""
        import sys

        frame = sys._current_frames().get(self._thread.ident or 0)
        return "" if frame is None else "".join(traceback.format_stack(frame))

    def restart(self) -> None:
        """Replace the thread by a new one. A replaced thread that still runs ends as soon as its item is handled."""
        with self._changed:
            self._busy_since, self.failure = None, ""
            self._thread = self._new_thread()
            self._thread.start()

    def close(self, timeout: float) -> None:
        """End the thread after the item in progress; wait at most `timeout` seconds for that."""
        with self._changed:
            self._is_closing = True
            self._changed.notify_all()
        if self._thread.ident is not None:
            self._thread.join(timeout)

    def _new_thread(self) -> threading.Thread:
        return threading.Thread(target=self._run, name=self.name, daemon=True)

    def _run(self) -> None:
        try:
            while (item := self._wait()) is not None:
                try:
                    self._handle(item)
                except Exception:
                    log.exception("the %s thread could not handle an item", self.name)
        except BaseException:
            if self.is_current:
                self.failure = traceback.format_exc()
            log.critical("the %s thread ended", self.name, exc_info=True)

    def _wait(self) -> T | None:
        """The next item; None once the thread has to end."""
        with self._changed:
            if self.is_current:
                self._busy_since = None
            while self.is_current and not self._is_closing:
                item = self._take()
                if item is not None:
                    self._busy_since = time.monotonic()
                    return item
                self._changed.wait(self._poll)
        return None
