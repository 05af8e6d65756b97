"""Feature points: positions with covariances and the observations they were triangulated from."""

from dataclasses import dataclass

import numpy as np

from fairing.scene import SparsePoints


@dataclass(frozen=True, eq=False)
class FeaturePoints:
    """Points triangulated from photos with known cameras.

    Observations are in compressed rows: point p has the observations `offsets[p]` to `offsets[p + 1]`, in the order of
    the photos.

    Attributes:
        positions: (p, 3) float, world units.
        covariance: (p, 3, 3) float, world units squared, of each position.
        colors: (p, 3) uint8, RGB.
        offsets: (p + 1,) int.
        photos: (o,) int: photo of each observation, an index of the scene's views.
        pixels: (o, 2) float, px, integers at pixel centres: where that photo shows the point.
        residual: (p,) float, px: mean distance of a point's projections from its observations.
        keypoint_sigma: px: estimated standard deviation of a keypoint's coordinate.
        reason: why there are no points; empty where there are some.
    """

    positions: np.ndarray
    covariance: np.ndarray
    colors: np.ndarray
    offsets: np.ndarray
    photos: np.ndarray
    pixels: np.ndarray
    residual: np.ndarray
    keypoint_sigma: float
    reason: str = ""

    @classmethod
    def none(cls, reason: str) -> "FeaturePoints":
        """No points, and why."""
        return cls(
            np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros((0, 3), np.uint8), np.zeros(1, np.int64),
            np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros(0), 0.0, reason,
        )  # fmt: skip

    def __len__(self) -> int:
        return len(self.positions)

    @property
    def views_per_point(self) -> np.ndarray:
        """(p,) int: photos that see each point."""
        return np.diff(self.offsets)

    def sparse_points(self) -> SparsePoints:
        """The points as a capture's sparse points; covariances and residuals are not part of those."""
        point = np.repeat(np.arange(len(self)), self.views_per_point)
        return SparsePoints(self.positions, self.colors, np.column_stack([point, self.photos]), self.pixels)
