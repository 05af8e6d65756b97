"""The exception that a user's mistake raises, and the one that ends a step nobody wants any more."""


class InputError(ValueError):
    """Something the user gave cannot be used.

    The message is one line: which file or item, what was expected, what was found, what to do. The command line prints
    it without a traceback and exits with code 1; the page shows it as a notification.
    """

    def __init__(self, message: str) -> None:
        # Names of files may hold line breaks, and so may what other libraries say.
        super().__init__(" ".join(message.splitlines()))


class Cancelled(Exception):  # noqa: N818 - nothing is wrong
    """A step was dropped as if it had never begun, because `Session.cancel_requested` said so."""
