"""Ctrl-C as a request to stop: the command finishes tidily and keeps what it has done."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager


class Interrupt:
    """The first Ctrl-C sets `requested`; a second one raises KeyboardInterrupt."""

    def __init__(self) -> None:
        self.requested = False

    @contextmanager
    def listening(self) -> Iterator["Interrupt"]:
        """Handle SIGINT inside the `with` block."""
        before = signal.signal(signal.SIGINT, self._request)
        try:
            yield self
        finally:
            signal.signal(signal.SIGINT, before)

    def _request(self, *_: object) -> None:
        if self.requested:
            raise KeyboardInterrupt
        self.requested = True
