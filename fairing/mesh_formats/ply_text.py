"""Items of one element of a text PLY file: one line each.

Items with the same lengths of lists have their words at the same places and are read together.
"""

from dataclasses import replace

import numpy as np

from fairing.errors import InputError
from fairing.mesh_formats.numbers import float_texts, floats, shown, whole
from fairing.mesh_formats.ply_header import Element, Property, values_of_corners


class TextItems:
    """The items of an element."""

    def __init__(self, element: Element, lines: list[bytes], numbers: list[int]) -> None:
        """The items in lines of a file, with the lines' numbers.

        Raises:
            InputError: a line has not the words that the header declares.
        """
        self._element, self._lines, self._numbers = element, lines, numbers
        groups: dict[tuple[int, ...], list[int]] = {}
        has_lists, n_words = any(p.is_list for p in element.properties), len(element.properties)
        for row, line in enumerate(lines):
            words = line.split()
            lengths = self._lengths(words) if has_lists else () if len(words) == n_words else None
            if lengths is None:
                raise self._unexpected(row, f"the properties of element {element.name}")
            groups.setdefault(lengths, []).append(row)
        self._groups = groups

    def numbers(self, properties: list[Property]) -> np.ndarray:
        """(n, k) float64 of k single values."""
        values = np.empty((self._element.count, len(properties)))
        for lengths, rows in self._groups.items():
            starts = self._starts(lengths)
            places = [starts[self._element.properties.index(p)] for p in properties]
            words = [words[place] for words in map(bytes.split, map(self._lines.__getitem__, rows)) for place in places]
            try:
                values[rows] = np.array(floats(words)).reshape(len(rows), len(places))
            except ValueError:
                raise self._malformed(
                    rows, places, floats, f"numbers {', '.join(p.name for p in properties)}"
                ) from None
        return values

    def lists(self, p: Property) -> tuple[np.ndarray, np.ndarray]:
        """The values of all lists, one after the other, and (n,) int64 their lengths."""
        i = self._element.properties.index(p)
        which = sum(other.is_list for other in self._element.properties[:i])
        is_whole = np.dtype(p.type).kind in "iu"
        converted, dtype = (whole, np.dtype(np.int64)) if is_whole else (floats, np.dtype(np.float64))
        lengths_of_rows = np.zeros(self._element.count, dtype=np.int64)
        for lengths, rows in self._groups.items():
            lengths_of_rows[rows] = lengths[which]
        values = np.empty(lengths_of_rows.sum(), dtype)
        first = np.cumsum(lengths_of_rows) - lengths_of_rows
        for lengths, rows in self._groups.items():
            start, length = self._starts(lengths)[i], lengths[which]
            words = [word for row in rows for word in self._lines[row].split()[start : start + length]]
            try:
                found = np.array(converted(words), dtype).reshape(len(rows), length)
            except ValueError:
                places = list(range(start, start + length))
                raise self._malformed(rows, places, converted, f"{'whole ' * is_whole}numbers {p.name}") from None
            values[first[rows][:, None] + np.arange(length)] = found
        return values, lengths_of_rows

    def replaced(self, columns: dict[str, np.ndarray], line_break: bytes) -> bytes:
        """The lines with other single values, (n,) float arrays by property; all other words as they are."""
        properties = [(i, p.name) for i, p in enumerate(self._element.properties) if p.name in columns]
        texts = {name: [row[0] for row in float_texts(columns[name][:, None])] for _, name in properties}
        lines = list(self._lines)
        for lengths, rows in self._groups.items():
            starts = self._starts(lengths)
            places = [(starts[i], texts[name]) for i, name in properties]
            for row in rows:
                words = lines[row].split()
                for place, column in places:
                    words[place] = column[row]
                lines[row] = b" ".join(words)
        return line_break.join([*lines, b""])

    def cut(self, corners: Property, pieces: dict[int, np.ndarray]) -> "TextItems":
        """The items with some polygons as triangles, (t, 3) int places among their corners by index of the item.

        Lists with values for each corner are cut with it, and other properties repeated.
        """
        lines = []
        for row, line in enumerate(self._lines):
            lines += self._cut(line.split(), corners, pieces[row]) if row in pieces else [line]
        return TextItems(replace(self._element, count=len(lines)), lines, [0] * len(lines))

    def _cut(self, words: list[bytes], corners: Property, triangles: np.ndarray) -> list[bytes]:
        lengths = self._lengths(words)
        assert lengths is not None
        starts, left = self._starts(lengths), iter(lengths)
        size = int(words[starts[self._element.properties.index(corners)] - 1])
        lines = [[] for _ in triangles]
        for p, start in zip(self._element.properties, starts, strict=True):
            length = next(left) if p.is_list else 1
            for line, places in zip(lines, values_of_corners(p.is_list, length, size, triangles), strict=True):
                line += [b"%d" % len(places)] * p.is_list + [words[start + place] for place in places]
        return [b" ".join(line) for line in lines]

    def _lengths(self, words: list[bytes]) -> tuple[int, ...] | None:
        """Lengths of the lists of an item; None if its line has other words than declared."""
        lengths, at = [], 0
        for p in self._element.properties:
            if p.is_list:
                word = words[at] if at < len(words) else b""
                if not word.isdigit() or len(word) > 9:
                    return None
                lengths.append(int(word))
                at += lengths[-1]
            at += 1
        return tuple(lengths) if at == len(words) else None

    def _starts(self, lengths: tuple[int, ...]) -> list[int]:
        """Index of the first word of each property, in items whose lists have these lengths."""
        starts, at, left = [], 0, iter(lengths)
        for p in self._element.properties:
            at += p.is_list
            starts.append(at)
            at += next(left) if p.is_list else 1
        return starts

    def _malformed(self, rows: list[int], places: list[int], converted, expected: str) -> InputError:
        """The error about the first of some items whose words at these places cannot be converted."""
        for row in rows:
            words = self._lines[row].split()
            try:
                converted([words[place] for place in places])
            except ValueError:
                return self._unexpected(row, expected)
        raise AssertionError("all items can be converted")

    def _unexpected(self, row: int, expected: str) -> InputError:
        return InputError(f"line {self._numbers[row]}: expected {expected}, found {shown(self._lines[row])}")
