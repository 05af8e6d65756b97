"""Options of structure from motion."""

from dataclasses import dataclass

from fairing.errors import InputError

SMALLEST_SIDE = 200
"""Pixels of the longer side; smaller photos have too few features."""


@dataclass(frozen=True)
class StructureOptions:
    """Options of the command `cameras`."""

    largest_side: int = 1600
    """Photos are reduced to this length of their longer side, pixels: features are found, and photos of the capture written, at
    this size."""
    threads: int = 0
    """Threads; 0: one per core."""

    def __post_init__(self) -> None:
        for name, low in (("largest_side", SMALLEST_SIDE), ("threads", 0)):
            value = getattr(self, name)
            if value < low:
                raise InputError(f"option {name}: expected at least {low}, found {value}")
