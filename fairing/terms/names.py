"""Names of the terms of the objective, in the order of legends and tables."""

from collections.abc import Iterable

PHOTOS = "photos"
POINTS = "points"
IMAGE_EDGES = "image edges"
AXES = "axes"
SMOOTHNESS = "smoothness"
START = "start"

TERMS: dict[str, str] = {
    PHOTOS: "differences between the photos of each face, after the robust loss",
    POINTS: "sparse points that lie off their closest face",
    IMAGE_EDGES: "creases of the mesh that lie off their edge in the photos",
    AXES: "edges and faces that nearly follow the axes of a building, but not quite",
    SMOOTHNESS: "vertices that lie off the smoothed mesh",
    START: "vertices that lie off the start; the more, the less the photos agree",
}
"""What adds to the energy of each built-in term."""

_numbered = list(TERMS)


def number_terms(names: Iterable[str]) -> None:
    """Give a number to each name that has none. Numbers hold for all sessions of a process; nothing else of a term does."""
    _numbered.extend(name for name in dict.fromkeys(names) if name not in _numbered)


def numbered_terms() -> tuple[str, ...]:
    """The names by their numbers, which pages and conditions use: the built-in ones, then those of one's own."""
    return tuple(_numbered)
