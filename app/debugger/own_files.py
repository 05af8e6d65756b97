"""Files with code of one's own: watched while a page is open, so that a saved change takes effect at once."""

import threading
from collections.abc import Callable, Sequence
from pathlib import Path

from app.debugger.commands import Command, LoadOwn

EVERY = 0.5  # s between two looks at the files


class OwnFiles:
    """Posts `LoadOwn` when one of the files has changed.

    Args:
        files: with the terms and the norm of the first run, see `Session.own_files`.
        post: receives the command.
    """

    def __init__(self, files: Sequence[str], post: Callable[[Command], None]) -> None:
        self._files, self._post = tuple(Path(file) for file in files), post
        self._ended = threading.Event()
        if self._files:
            threading.Thread(target=self._watch, name="own files", daemon=True).start()

    def close(self) -> None:
        """End the thread."""
        self._ended.set()

    def _watch(self) -> None:
        loaded = seen = self._states()
        while not self._ended.wait(EVERY):
            now = self._states()
            if now == seen != loaded:  # an editor may write in several steps
                loaded = now
                self._post(LoadOwn(self._files))
            seen = now

    def _states(self) -> list[tuple[int, int] | None]:
        """Time and size of each file; None while an editor replaces it."""
        return [_state(file) for file in self._files]


def _state(file: Path) -> tuple[int, int] | None:
    try:
        found = file.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size
