"""Options of image-consistent triangulation."""

from dataclasses import dataclass

from fairing.errors import InputError


@dataclass(frozen=True)
class TriangulationOptions:
    """Options of the start mesh and of edge flips."""

    max_vertices: int | None = None
    """Limit of the number of vertices; they stay where the surface bends most. Default: as many as `spacing` allows."""
    spacing: float = 14.0
    """Distance of vertices, px of a typical photo: about twice as far apart on walls, at least half as far at creases. Smaller
    faces have too little texture to judge."""
    min_photos: int = 3
    """Points seen by fewer photos are left out."""
    splits: int = 0
    """Rounds in which faces larger than `spacing` are divided where points near the surface contradict them, before any flip. For
    meshes that `fair` has refined (ledger: face splits); `max_vertices` does not count the new vertices."""
    gain: float = 0.05
    """An edge is flipped if the loss in the photos that see all four faces decreases by more than this fraction."""
    blur: float = 2.0
    """Blur of the photos in which faces are judged, px: about the error of the points."""
    threads: int = 0
    """Threads; 0: one per core. The result is the same for any number."""

    def __post_init__(self) -> None:
        for name, low in (("spacing", 1), ("min_photos", 2), ("splits", 0), ("gain", 0), ("blur", 0), ("threads", 0)):
            value = getattr(self, name)
            if not low <= value < float("inf"):
                raise InputError(f"option {name}: expected at least {low}, found {value}")
        if self.max_vertices is not None and self.max_vertices < 3:
            raise InputError(f"option max-vertices: expected at least 3, found {self.max_vertices}")
