"""Error toasts: exceptions in callbacks are shown as red notifications.

viser 1.1.1 only prints them on standard error, where a user of the page does not look.
"""

import logging
import time
from collections.abc import Callable

import viser

from fairing.errors import InputError

TOAST_SECONDS = 10
REPEAT_SECONDS = 1.0  # the same message again within this time is not shown again


class ErrorToasts:
    """Wraps the callbacks of one browser."""

    def __init__(self, client: viser.ClientHandle) -> None:
        self._client = client
        self._latest: tuple[str, float] = ("", 0.0)

    def __call__(self, call: Callable[..., None]) -> Callable[..., None]:
        """The same callback, except that it shows what it raises instead."""

        def guarded(*args: object) -> None:
            try:
                call(*args)
            except InputError as error:
                self.show(str(error))
            except Exception as error:
                logging.getLogger(__name__).exception("a callback failed")
                self.show(f"{type(error).__name__}: {error}")

        return guarded

    def without_event(self, call: Callable[[], None]) -> Callable[..., None]:
        """The same for a callback without arguments: the result accepts and ignores any."""
        return self(lambda *_: call())

    def show(self, message: str) -> None:
        """Show a red notification for some seconds."""
        now = time.monotonic()
        if message == self._latest[0] and now < self._latest[1] + REPEAT_SECONDS:
            return
        self._latest = (message, now)
        self._client.add_notification("That did not work", message, auto_close_seconds=TOAST_SECONDS, color="red")
