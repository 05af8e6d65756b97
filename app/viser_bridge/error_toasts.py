"""Toasts: exceptions in callbacks are shown as notifications, red if they are errors.

viser 1.1.1 only prints them on standard error, where a user of the page does not look.
"""

import logging
import time
from collections.abc import Callable
from typing import Literal

import viser

from fairing.errors import InputError

TOAST_SECONDS = 10
NOTICE_SECONDS = 5


class NothingToDo(InputError):  # noqa: N818 - nothing is wrong
    """A request that makes sense but has nothing to act on at present. Shown as a notice, not as an error."""


class ErrorToasts:
    """Wraps the callbacks of one browser."""

    def __init__(self, client: viser.ClientHandle) -> None:
        self._client = client
        self._shown: dict[str, tuple[viser.NotificationHandle, float]] = {}

    def __call__(self, call: Callable[..., None]) -> Callable[..., None]:
        """The same callback, except that it shows what it raises instead."""

        def guarded(*args: object) -> None:
            try:
                call(*args)
            except NothingToDo as notice:
                self._add("Nothing to do", str(notice), NOTICE_SECONDS, "gray")
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
        """Show an error for some seconds."""
        self._add("That did not work", message, TOAST_SECONDS, "red")

    def _add(self, title: str, message: str, seconds: float, color: Literal["red", "gray"]) -> None:
        """Show a message, or show it for longer if it is there already: a key that is pressed again adds no second one."""
        now = time.monotonic()
        self._shown = {text: shown for text, shown in self._shown.items() if now < shown[1]}
        if message in self._shown:
            toast = self._shown[message][0]
            # The page starts its timer anew when the duration changes, and shows a toast of the same id only if it was closed.
            toast.auto_close_seconds = seconds if toast.auto_close_seconds != seconds else seconds + 0.001
            toast._show()
        else:
            toast = self._client.add_notification(title, message, auto_close_seconds=seconds, color=color)
        self._shown[message] = (toast, now + seconds)
