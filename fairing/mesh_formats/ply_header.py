"""Headers of PLY files: elements, their properties, and the lines as they are written.

Source: Turk, The PLY Polygon File Format, 1994, https://paulbourke.net/dataformats/ply/.
"""

import re
from dataclasses import dataclass

import numpy as np

from fairing.errors import InputError
from fairing.mesh_formats.numbers import count

_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4", "double": "f8",
    "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4", "float32": "f4",
    "float64": "f8",
}  # fmt: skip
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_END = re.compile(rb"^[ \t]*end_header[ \t]*(\r\n|\n|\r)", re.MULTILINE)
LONGEST_HEADER = 1 << 20
"""Bytes of a header."""


@dataclass(frozen=True)
class Property:
    """One property of an element.

    Attributes:
        type: of the value, or of the values of a list, as NumPy names it, without byte order.
        count_type: type of a list's length; empty for a single value.
        line: index of its line in the header.
    """

    name: str
    type: str
    count_type: str
    line: int

    @property
    def is_list(self) -> bool:
        return bool(self.count_type)


@dataclass(frozen=True)
class Element:
    """One kind of item, with the number of them that the header declares."""

    name: str
    count: int
    properties: tuple[Property, ...]

    def scalars(self, *names: str) -> list[Property] | None:
        """The properties of these names if all of them exist and are single values."""
        found = {p.name: p for p in self.properties if not p.is_list}
        return [found[name] for name in names] if found.keys() >= set(names) else None

    def list_named(self, *names: str) -> Property | None:
        """The first list with one of these names."""
        return next((p for p in self.properties if p.is_list and p.name in names), None)


@dataclass(frozen=True)
class PlyHeader:
    """A header.

    Attributes:
        order: byte order as NumPy writes it; empty for text.
        lines: the header's lines without line breaks, "end_header" last.
        line_break: the line break after "end_header".
        size: bytes of the header.
    """

    order: str
    elements: tuple[Element, ...]
    lines: tuple[str, ...]
    line_break: str
    size: int

    def written(self, types: dict[int, str], n_faces: int | None = None) -> bytes:
        """The header's bytes with other types of single values, PLY type by index of the line, and number of faces."""
        lines = list(self.lines)
        if n_faces is not None:
            face = next(i for i, line in enumerate(lines) if line.split()[:2] == ["element", "face"])
            lines[face] = f"element face {n_faces}"
        for line, type in types.items():
            lines[line] = f"property {type} {lines[line].split()[-1]}"
        return "".join(line + self.line_break for line in lines).encode("latin-1")


def parse_header(data: bytes) -> PlyHeader:
    """The header at the start of a PLY file.

    Raises:
        InputError: it is no PLY header.
    """
    end = _END.search(data, 0, LONGEST_HEADER)
    if not data.startswith(b"ply") or end is None:
        raise InputError("expected a PLY header from `ply` to `end_header`, found none; export it again")
    lines = tuple(line.decode("latin-1") for line in data[: end.end()].splitlines())
    order: str | None = None
    elements: list[Element] = []
    for number, line in enumerate(lines):
        words = line.split()
        try:
            match words:
                case [] | ["ply"] | ["comment" | "obj_info", *_] | ["end_header"]:
                    continue
                case ["format", name, "1.0"] if order is None:
                    order = _ORDERS[name]
                case ["element", name, number_of] if name not in (element.name for element in elements):
                    elements.append(Element(name, count(number_of.encode()), ()))
                case ["property", *of]:
                    element = elements.pop()
                    elements.append(_with_property(element, of, number))
                case _:
                    raise ValueError("a line of a PLY header")
        except (KeyError, IndexError, ValueError):
            raise InputError(
                f"line {number + 1}: expected a format, an element or a property of PLY 1.0, each given once, "
                f"found {line[:60]!r}"
            ) from None
    if order is None:
        raise InputError("expected a line `format` in the PLY header, found none; export it again")
    for element in elements:
        if element.count and not element.properties:
            raise InputError(f"element {element.name}: expected properties, found none; export it again")
    return PlyHeader(order, tuple(elements), lines, end[1].decode(), end.end())


def values_of_corners(is_list: bool, length: int, size: int, triangles: np.ndarray) -> list[list[int]]:
    """Which values of a property of a polygon each of its triangles gets, as indices.

    A list has values for each corner if its length is a multiple of the number of corners.

    Args:
        length: number of values of the property.
        size: number of corners of the polygon.
        triangles: (t, 3) int, places among the corners.
    """
    if not is_list or length == 0 or length % size:
        return [list(range(length))] * len(triangles)
    each = length // size
    return [[each * corner + i for corner in triangle for i in range(each)] for triangle in triangles.tolist()]


def _with_property(element: Element, words: list[str], line: int) -> Element:
    match words:
        case ["list", length, type, name] if np.dtype(_TYPES[length]).kind in "iu":
            added = Property(name, _TYPES[type], _TYPES[length], line)
        case [type, name]:
            added = Property(name, _TYPES[type], "", line)
        case _:
            raise ValueError("a property")
    if name in (p.name for p in element.properties):
        raise ValueError("given twice")
    return Element(element.name, element.count, (*element.properties, added))
