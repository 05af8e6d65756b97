"""Choices of image-consistent triangulation."""

from dataclasses import dataclass

from fairing.errors import InputError


@dataclass(frozen=True)
class TriangulationOptions:
    """How points become a start mesh, and when an edge is flipped."""

    max_vertices: int | None = None
    """At most so many points become vertices: those that most photos see, well spread. Default: as many as `spacing` allows."""
    spacing: float = 16.0
    """Smallest distance of two vertices in the central photo, px: smaller faces hold too little texture to judge."""
    min_photos: int = 3
    """Points that fewer photos see are left out."""
    gain: float = 0.05
    """An edge is flipped when that lowers the loss in the photos that see all four faces by more than this fraction."""
    blur: float = 2.0
    """Blur of the photos that faces are judged by, px: about as far as points may be off."""
    threads: int = 0
    """Threads; 0: one per core. The result is the same for any number."""

    def __post_init__(self) -> None:
        for name, low in (("spacing", 1), ("min_photos", 2), ("gain", 0), ("blur", 0), ("threads", 0)):
            value = getattr(self, name)
            if not low <= value < float("inf"):
                raise InputError(f"option {name}: expected at least {low}, found {value}")
        if self.max_vertices is not None and self.max_vertices < 3:
            raise InputError(f"option max-vertices: expected at least 3, found {self.max_vertices}")
