"""Observed points: points with the pixels where photos show them, as bundle adjustment needs them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fairing.features.points import FeaturePoints
from fairing.lens import Lens

SAME_PIXEL = 6  # decimals, px: undistorting and distorting a pixel changes its last digits


@dataclass(frozen=True, eq=False)
class ObservedPoints:
    """Points and their observations, ordered by point; every point has at least one observation.

    Attributes:
        positions: (p, 3) float, world units.
        point: (o,) int, ascending: point of each observation.
        photo: (o,) int: photo of each observation.
        pixels: (o, 2) float, px, integers at pixel centres.
    """

    positions: np.ndarray
    point: np.ndarray
    photo: np.ndarray
    pixels: np.ndarray

    @classmethod
    def of_features(cls, found: FeaturePoints) -> "ObservedPoints":
        """The points found in photos."""
        point = np.repeat(np.arange(len(found)), found.n_views)
        return cls(found.positions, point, found.photos.astype(np.int64), found.pixels)

    def __len__(self) -> int:
        return len(self.positions)

    @property
    def starts(self) -> np.ndarray:
        """(p,) int: first observation of each point."""
        return np.searchsorted(self.point, np.arange(len(self)))

    def at(self, positions: np.ndarray) -> "ObservedPoints":
        """The same observations with the points at other positions (p, 3), world units."""
        return replace(self, positions=positions)

    def distorted(self, lenses: Sequence[Lens]) -> "ObservedPoints":
        """The same points, whose pixels are in photos undistorted from these lenses, at the pixels of the distorted photos."""
        pixels = self.pixels.copy()
        for v, lens in enumerate(lenses):
            pixels[self.photo == v] = lens.distort(pixels[self.photo == v])
        return replace(self, pixels=pixels)

    def chosen(self, mask: np.ndarray) -> "ObservedPoints":
        """The points where a mask (p,) bool is true, with their observations."""
        kept = mask[self.point]
        number = np.cumsum(mask) - 1
        return ObservedPoints(
            self.positions[mask], number[self.point[kept]], self.photo[kept], self.pixels[kept]
        )  # fmt: skip

    def shares_observation(self, others: "ObservedPoints") -> np.ndarray:
        """(p,) bool: whether another set has an observation at the same pixel of the same photo, to `SAME_PIXEL` decimals."""
        mine, theirs = (
            np.ascontiguousarray(np.column_stack([s.photo, np.round(s.pixels, SAME_PIXEL)])).view("V24").ravel()
            for s in (self, others)
        )
        shared = np.isin(mine, theirs)
        return np.bincount(self.point, shared, minlength=len(self)) > 0
