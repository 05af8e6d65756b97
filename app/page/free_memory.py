"""Free memory: what has been freed is returned to the operating system."""

import ctypes
import gc
import sys
import threading
import time

from app.background_worker import BackgroundWorker
from app.debugger.run_state import Activity, RunState

PAGE_SECONDS = 2.0  # after a page has gone: several that go together are freed together
REST_SECONDS = 30.0  # at least, between two returns while the engine rests
MAX_HEAPS = 2  # of glibc, shared by some 25 threads
M_ARENA_MAX = -8  # glibc, malloc.h


class FreeMemory:
    """Returns memory after a page has gone and, from time to time, when the engine rests.

    Handles of a closed page refer to each other in cycles, which Python would leave for minutes. And glibc gives every thread
    a heap of its own, whose free memory the other threads do not use; here they share a few (ledger: allocator).
    """

    def __init__(self) -> None:
        _glibc("mallopt", M_ARENA_MAX, MAX_HEAPS)
        self._worker = BackgroundWorker(name="garbage")
        self._next = time.monotonic() + REST_SECONDS
        self._lock = threading.Lock()

    def page_has_gone(self) -> None:
        """Collect the page, and return its memory, a little later."""
        self._worker.post("pages", _free_pages, lambda _: None)

    def follow(self, state: RunState) -> None:
        """Return memory if the engine rests and it is time again."""
        with self._lock:
            is_due = state.activity is Activity.PAUSED and time.monotonic() >= self._next
            self._next = time.monotonic() + REST_SECONDS if is_due else self._next
        if is_due:
            self._worker.post("rest", return_free_memory, lambda _: None)

    def close(self) -> None:
        """Return nothing more."""
        self._worker.close(timeout=0)


def return_free_memory() -> None:
    """Return the free memory of all heaps to the operating system; does nothing where the C library is not glibc."""
    _glibc("malloc_trim", 0)


def _glibc(name: str, *args: int) -> None:
    """Call a function that only glibc has."""
    function = getattr(ctypes.CDLL(None), name, None) if sys.platform == "linux" else None
    if function is not None:
        function(*args)


def _free_pages() -> None:
    time.sleep(PAGE_SECONDS)
    gc.collect()
    return_free_memory()
