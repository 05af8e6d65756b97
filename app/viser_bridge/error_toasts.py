"""What a user's click throws becomes a red note, and the page lives on."""

import logging
from collections.abc import Callable

import viser

from fairing.errors import InputError

NOTE_SECONDS = 10


class Guard:
    """Wraps what is called by clicks of one browser."""

    def __init__(self, client: viser.ClientHandle) -> None:
        self._client = client

    def __call__(self, call: Callable[..., None]) -> Callable[..., None]:
        """The same, with whatever arguments, but it never throws."""

        def guarded(*args: object) -> None:
            try:
                call(*args)
            except InputError as error:
                self.notify(str(error))
            except Exception as error:
                logging.getLogger(__name__).exception("a click failed")
                self.notify(f"{type(error).__name__}: {error}")

        return guarded

    def without_event(self, call: Callable[[], None]) -> Callable[..., None]:
        """The same for what wants no arguments."""
        return self(lambda *_: call())

    def notify(self, message: str) -> None:
        """A red note for some seconds."""
        self._client.add_notification("That did not work", message, auto_close_seconds=NOTE_SECONDS, color="red")
