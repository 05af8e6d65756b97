"""Cancellation: asks the computation in progress on the engine thread to stop."""

import threading
import time


class Cancellation:
    """A flag that computations poll (`Session.cancel_requested`) and playback waits on.

    `abandon` sets the flag for good: the thread that polls it was replaced and must change nothing any more.
    """

    def __init__(self) -> None:
        self._event = threading.Event()
        self._requested_at: float | None = None
        self.is_abandoned = False

    def request(self) -> None:
        if not self._event.is_set():
            self._requested_at = time.monotonic()
        self._event.set()

    @property
    def seconds(self) -> float:
        """Time since the request; 0 without one."""
        since = self._requested_at
        return 0.0 if since is None else time.monotonic() - since

    def requested(self) -> bool:
        return self._event.is_set()

    def wait(self, seconds: float) -> bool:
        """Wait for a request for at most `seconds`; returns whether there is one."""
        return self._event.wait(seconds)

    def clear(self) -> None:
        """Withdraw the request, unless abandoned."""
        if not self.is_abandoned:
            self._event.clear()
            self._requested_at = None

    def abandon(self) -> None:
        self.is_abandoned = True
        self._event.set()
