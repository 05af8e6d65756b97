"""Work in progress: what a long computation does at present, and how much of it is done."""

import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")


@dataclass(eq=False)
class Work:
    """A computation that consists of `count` parts.

    Attributes:
        text: a participle with its object, such as "searching 81 vertices".
        count: number of parts.
        part: what a part is, such as "direction"; empty where the object says it.
        done: number of finished parts; of a single one the finished fraction, if it is known.
        began: `time.monotonic` at the beginning, s.
    """

    text: str
    count: int = 1
    part: str = ""
    done: float = 0
    began: float = field(default_factory=time.monotonic)
    _lock: threading.Lock = field(default_factory=threading.Lock, repr=False)

    def advance(self) -> None:
        """Count one more part as finished; called from any thread."""
        with self._lock:
            self.done = min(self.done + 1, self.count)

    def each(self, items: Iterable[Item]) -> Iterator[Item]:
        """Iterate over items; an item counts as a finished part when the next one is requested."""
        for item in items:
            yield item
            self.advance()

    def counted(self, compute: Callable[[Item], Result]) -> Callable[[Item], Result]:
        """The function; each of its calls counts as a part."""

        def counting(item: Item) -> Result:
            result = compute(item)
            self.advance()
            return result

        return counting


class WorkLog:
    """The works in progress. They are begun and ended by any thread and read by any other."""

    def __init__(self) -> None:
        self._works: tuple[Work, ...] = ()
        self._lock = threading.Lock()

    @property
    def current(self) -> tuple[Work, ...]:
        """The works in progress; each is a part of the one before it."""
        return self._works

    def photo_read(self, done: int, count: int) -> None:
        """Show that `done` of `count` photos have been read, in place of the innermost work's own parts."""
        if self._works:
            work = self._works[-1]
            work.text, work.part, work.done, work.count = "reading the photos", "", done, count

    @contextmanager
    def doing(self, text: str, count: int = 1, part: str = "") -> Iterator[Work]:
        """A work that is in progress while the `with` block runs; see `Work`."""
        work = Work(text, count, part)
        with self._lock:
            self._works = (*self._works, work)
        try:
            yield work
        finally:
            with self._lock:
                self._works = tuple(other for other in self._works if other is not work)


def fraction_done(works: Iterable[Work]) -> float:
    """Finished fraction of the first of nested works, 0 to 1."""
    done, part = 0.0, 1.0
    for work in works:
        done += part * work.done / work.count
        part /= work.count
    return min(done, 1.0)
