"""Exceptions: `InputError` for input that cannot be used, `Cancelled` for a cancelled computation."""


class InputError(ValueError):
    """Something the user gave cannot be used.

    The message is one line: which file or item, what was expected, what was found, what to do. The command line prints
    it without a traceback and exits with code 1; the page shows it as a notification.
    """

    LONGEST = 1000
    """Characters of a message; a longer one, as a damaged file may cause, loses its middle."""

    def __init__(self, message: str) -> None:
        # Names of files and messages of other libraries may hold line breaks.
        line = " ".join(message.splitlines())
        if len(line) > self.LONGEST:
            line = f"{line[: self.LONGEST // 2]} ... {line[5 - self.LONGEST // 2 :]}"
        super().__init__(line)


class Cancelled(Exception):  # noqa: N818 - nothing is wrong
    """Raised within a computation when cancellation was requested; the state is as before it began."""
