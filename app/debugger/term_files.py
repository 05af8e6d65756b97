"""Files with terms of one's own: watched while a page is open, so that a saved change takes effect at once."""

import threading
from collections.abc import Callable, Sequence
from pathlib import Path

from app.debugger.commands import Command, LoadTerms
from fairing.terms.own import OwnTerm

EVERY = 0.5  # s between two looks at the files


class TermFiles:
    """Posts `LoadTerms` when one of the files has changed.

    Args:
        terms: of the first run.
        post: receives the command.
    """

    def __init__(self, terms: Sequence[OwnTerm], post: Callable[[Command], None]) -> None:
        self._files, self._post = tuple(dict.fromkeys(Path(term.file) for term in terms if term.file)), post
        self._ended = threading.Event()
        if self._files:
            threading.Thread(target=self._watch, name="term files", daemon=True).start()

    def close(self) -> None:
        """End the thread."""
        self._ended.set()

    def _watch(self) -> None:
        loaded = seen = self._states()
        while not self._ended.wait(EVERY):
            now = self._states()
            if now == seen != loaded:  # an editor may write in several steps
                loaded = now
                self._post(LoadTerms(self._files))
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
