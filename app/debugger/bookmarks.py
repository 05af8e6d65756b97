"""Bookmarks: moments of a run with a note, and the file beside the run that stores them."""

import json
from dataclasses import dataclass, replace
from pathlib import Path

from fairing.errors import InputError
from fairing.io import write_atomically
from fairing.io.json_file import read_json

MAX_BOOKMARKS = 200
MAX_NOTE = 200  # characters


@dataclass(frozen=True)
class Bookmark:
    """A moment with a note.

    Attributes:
        number: identifies the bookmark.
        run_id: the run it belongs to.
        moment: the moment in that run.
        at: the moment's id, for `--at`.
        note: the user's text, one line.
    """

    number: int
    run_id: int
    moment: int
    at: str
    note: str


class Bookmarks:
    """An immutable list of bookmarks; every change returns a new list."""

    def __init__(self, items: tuple[Bookmark, ...] = (), next_number: int = 1) -> None:
        self.items, self._next_number = items, next_number

    def added(self, run_id: int, moment: int, at: str, note: str) -> "Bookmarks":
        """The list with one more bookmark; a bookmark of the same moment gets the new note.

        Raises:
            InputError: the note is too long, or the list is full.
        """
        # Lone surrogates, which no UTF-8 file can hold, become question marks.
        note = " ".join(note.split()).encode(errors="replace").decode()
        if len(note) > MAX_NOTE:
            raise InputError(f"bookmark: expected a note of at most {MAX_NOTE} characters, found {len(note)}")
        for item in self.items:
            if (item.run_id, item.moment) == (run_id, moment):
                changed = replace(item, note=note or item.note)
                return Bookmarks(tuple(changed if other is item else other for other in self.items), self._next_number)
        if len(self.items) >= MAX_BOOKMARKS:
            raise InputError(f"expected at most {MAX_BOOKMARKS} bookmarks; remove some first")
        items = (*self.items, Bookmark(self._next_number, run_id, moment, at, note))
        return Bookmarks(tuple(sorted(items, key=lambda b: (b.run_id, b.moment))), self._next_number + 1)

    def removed(self, number: int) -> "Bookmarks":
        return Bookmarks(tuple(item for item in self.items if item.number != number), self._next_number)

    def without_run(self, run_id: int) -> "Bookmarks":
        return Bookmarks(tuple(item for item in self.items if item.run_id != run_id), self._next_number)

    def numbered(self, number: int) -> Bookmark:
        """The bookmark of a number.

        Raises:
            InputError: there is none.
        """
        for item in self.items:
            if item.number == number:
                return item
        raise InputError(f"bookmark {number}: does not exist any more")

    def of_run(self, run_id: int) -> tuple[Bookmark, ...]:
        return tuple(item for item in self.items if item.run_id == run_id)


def file_beside(trace: Path) -> Path:
    """The bookmark file of a trace: `run.bookmarks.json` for `run.trace`."""
    return trace.with_suffix(".bookmarks.json")


def write_bookmarks(path: Path, items: tuple[Bookmark, ...]) -> None:
    """Write the bookmark file, complete or not at all.

    Raises:
        InputError: the file cannot be written.
    """
    rows = [{"at": item.at, "moment": item.moment, "note": item.note} for item in items]
    text = json.dumps({"bookmarks": rows}, indent=1, ensure_ascii=False)
    write_atomically(path, lambda file: file.write(text.encode()))


def read_bookmarks(path: Path, last_moment: int) -> Bookmarks:
    """The bookmarks of the first run, from its file; an empty list if there is no file.

    Bookmarks of moments beyond the trace are dropped.

    Args:
        last_moment: the trace's last moment.

    Raises:
        InputError: the file is not a list of bookmarks.
    """
    if not path.exists():
        return Bookmarks()
    content = read_json(path, "a JSON list of bookmarks")
    bookmarks = Bookmarks()
    try:
        for row in content["bookmarks"]:
            moment, at, note = row["moment"].whole(), row["at"].text(), row["note"].text(may_be_empty=True)
            if moment <= last_moment:
                bookmarks = bookmarks.added(1, moment, at[:60], note[:MAX_NOTE])
    except InputError as error:
        raise InputError(f"{path}: {error}; correct the file or move it away") from None
    return bookmarks
