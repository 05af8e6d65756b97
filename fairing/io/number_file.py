"""Text files of plain numbers, read word by word."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from fairing.errors import InputError
from fairing.io.capture import read_text


class NumberFile:
    """The words of a text file, in order; errors name the line of a missing or malformed word."""

    def __init__(self, path: Path, expected: str, skip_lines: int = 0) -> None:
        self._path = path
        self._expected = expected
        self._lines = read_text(path, expected).splitlines()
        self._line = skip_lines
        self._words: Iterator[str] = iter(())

    @property
    def place(self) -> str:
        """The file and the line of the last word read, for messages."""
        return f"{self._path}: line {self._line}"

    def word(self, what: str) -> str:
        """The next word."""
        while True:
            word = next(self._words, None)
            if word is not None:
                return word
            if self._line >= len(self._lines):
                raise InputError(f"{self._path}: expected {what}, found the end of the file; it is incomplete")
            self._words = iter(self._lines[self._line].split())
            self._line += 1

    def numbers(self, count: int, what: str) -> np.ndarray:
        """The next words as finite numbers, (count,) float."""
        values = np.zeros(count)
        for i in range(count):
            word = self.word(what)
            try:
                values[i] = float(word)
            except ValueError:
                raise InputError(f"{self.place}: expected {what}, found {word[:40]!r}") from None
            if not np.isfinite(values[i]):
                raise InputError(f"{self.place}: expected {what}, found {word[:40]} instead of a finite number")
        return values

    def whole(self, what: str) -> int:
        """The next word as a whole number, not negative."""
        word = self.word(what)
        if not word.isascii() or not word.isdigit() or len(word) > 18:
            raise InputError(f"{self.place}: expected {what}, found {word[:40]!r}")
        return int(word)

    def finish(self) -> None:
        """Raise InputError if there is a further word."""
        rest = [*self._words, *(word for line in self._lines[self._line :] for word in line.split())]
        if rest:
            raise InputError(f"{self.place}: expected the end of the file, found {rest[0][:40]!r}")
