"""Selection: the vertices selected by click, by rectangle, or by their numbers."""

import re
from collections.abc import Iterable
from dataclasses import dataclass

from fairing.errors import InputError

MAX_LIST = 4000  # characters accepted from a browser
_PIECE = re.compile(r"(\d{1,12})(?:\s*[-–]\s*(\d{1,12}))?")


@dataclass(frozen=True)
class Selection:
    """The selected vertices.

    Attributes:
        vertices: ids in the order of selection; the last one is the current vertex.
    """

    vertices: tuple[int, ...] = ()

    @property
    def current(self) -> int | None:
        """The vertex whose cells and variables are shown; None if nothing is selected."""
        return self.vertices[-1] if self.vertices else None

    def toggled(self, vertex: int) -> "Selection":
        """With this vertex as the current one, or without it if it was selected."""
        others = tuple(v for v in self.vertices if v != vertex)
        return Selection(others if vertex in self.vertices else (*others, vertex))

    def extended(self, vertices: Iterable[int]) -> "Selection":
        """With more vertices; the current vertex stays the current one."""
        known = set(self.vertices)
        new = tuple(v for v in dict.fromkeys(vertices) if v not in known)
        return Selection((*new, *self.vertices))


def parse_vertices(written: object, last: int) -> Selection:
    """Parse a list such as `3, 17-20`; its first vertex becomes the current one.

    Args:
        written: a value sent by a browser.
        last: the largest vertex id.

    Raises:
        InputError: it is not a list of vertex ids; the message names the part that is wrong.
    """
    if not isinstance(written, str) or len(written) > MAX_LIST:
        raise InputError(f"vertices: expected a list such as 3, 17-20 of at most {MAX_LIST} characters")
    chosen: dict[int, None] = {}
    for piece in filter(None, (part.strip() for part in re.split(r"[,;\n]", written))):
        match = _PIECE.fullmatch(piece)
        if match is None:
            raise InputError(f"vertices: expected numbers and ranges such as 3, 17-20, found {piece[:40]!r}")
        first, end = int(match[1]), int(match[2] or match[1])
        if end < first:
            raise InputError(f"vertices: expected a range that runs upwards, found {piece}")
        if end > last:
            raise InputError(f"vertices: expected numbers 0 to {last}, found {end}")
        chosen.update(dict.fromkeys(range(first, end + 1)))
    return Selection(tuple(reversed(chosen)))


def list_vertices(vertices: Iterable[int]) -> str:
    """The shortest list of these vertices, ascending, such as `3, 17-20`."""
    runs: list[list[int]] = []
    for vertex in sorted(vertices):
        if runs and vertex == runs[-1][-1] + 1:
            runs[-1].append(vertex)
        else:
            runs.append([vertex])
    pieces = [str(run[0]) if len(run) == 1 else f"{run[0]}{'-' if len(run) > 2 else ', '}{run[-1]}" for run in runs]
    return ", ".join(pieces)
