"""Moments with a note, and the file beside a run that keeps them."""

import json
from dataclasses import dataclass, replace
from pathlib import Path

from fairing.errors import InputError
from fairing.io import write_atomically

MAX_BOOKMARKS = 200
MAX_NOTE = 200  # characters


@dataclass(frozen=True)
class Bookmark:
    """Attributes:
    number: its name.
    run_id: the run it belongs to.
    moment: in that run.
    at: the moment's id, for `--at`.
    note: what somebody wrote.
    """

    number: int
    run_id: int
    moment: int
    at: str
    note: str


class Bookmarks:
    """An unchangeable list of them; every change gives a new one."""

    def __init__(self, items: tuple[Bookmark, ...] = (), following: int = 1) -> None:
        self.items, self._following = items, following

    def added(self, run_id: int, moment: int, at: str, note: str) -> "Bookmarks":
        """With one more; the note of one that is there already is replaced.

        Raises:
            InputError: the note is too long, or there are too many.
        """
        note = " ".join(note.split())
        if len(note) > MAX_NOTE:
            raise InputError(f"bookmark: expected a note of at most {MAX_NOTE} characters, found {len(note)}")
        for item in self.items:
            if (item.run_id, item.moment) == (run_id, moment):
                changed = replace(item, note=note or item.note)
                return Bookmarks(tuple(changed if other is item else other for other in self.items), self._following)
        if len(self.items) >= MAX_BOOKMARKS:
            raise InputError(f"expected at most {MAX_BOOKMARKS} bookmarks; remove some first")
        items = (*self.items, Bookmark(self._following, run_id, moment, at, note))
        return Bookmarks(tuple(sorted(items, key=lambda b: (b.run_id, b.moment))), self._following + 1)

    def removed(self, number: int) -> "Bookmarks":
        return Bookmarks(tuple(item for item in self.items if item.number != number), self._following)

    def without_run(self, run_id: int) -> "Bookmarks":
        return Bookmarks(tuple(item for item in self.items if item.run_id != run_id), self._following)

    def numbered(self, number: int) -> Bookmark:
        """The one of that number.

        Raises:
            InputError: it is not there.
        """
        for item in self.items:
            if item.number == number:
                return item
        raise InputError(f"bookmark {number}: is not there any more")

    def of_run(self, run_id: int) -> tuple[Bookmark, ...]:
        return tuple(item for item in self.items if item.run_id == run_id)


def file_beside(trace: Path) -> Path:
    """Where the bookmarks of a record are kept: `run.trace` has them in `run.bookmarks.json`."""
    return trace.with_suffix(".bookmarks.json")


def write_bookmarks(path: Path, items: tuple[Bookmark, ...]) -> None:
    """Write them, complete or not at all.

    Raises:
        InputError: the file cannot be written.
    """
    rows = [{"at": item.at, "moment": item.moment, "note": item.note} for item in items]
    text = json.dumps({"bookmarks": rows}, indent=1, ensure_ascii=False)
    write_atomically(path, lambda file: file.write(text.encode()))


def read_bookmarks(path: Path, last_moment: int) -> Bookmarks:
    """Those of the first run, from its file; none if there is no file. Moments beyond the record are left out.

    Raises:
        InputError: the file is no list of bookmarks.
    """
    try:
        rows = json.loads(path.read_text(encoding="utf-8"))["bookmarks"]
        found = [(int(row["moment"]), str(row["at"]), str(row["note"])) for row in rows]
    except FileNotFoundError:
        return Bookmarks()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    except (ValueError, KeyError, TypeError):
        raise InputError(
            f"{path}: expected a JSON list of bookmarks, each with moment, at and note; mend it or move it away"
        ) from None
    bookmarks = Bookmarks()
    for moment, at, note in found:
        if 0 <= moment <= last_moment:
            bookmarks = bookmarks.added(1, moment, at[:60], note[:MAX_NOTE])
    return bookmarks
