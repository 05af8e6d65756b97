"""Feature points: positions with covariances and the observations they were triangulated from."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fairing.camera import Camera
from fairing.features.tracks import Tracks
from fairing.features.triangulation import Triangulated, information, reprojection
from fairing.scene import SparsePoints

PRIOR_FREEDOM = 6
"""Degrees of freedom of the prior on a point's variance: the mean of all points counts as much as residuals of so many."""


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
        keypoint_sigma: px: estimated standard deviation of a coordinate of the finest keypoints.
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

    @classmethod
    def of_sparse_points(cls, sparse: SparsePoints, cameras: Sequence[Camera]) -> "FeaturePoints":
        """The sparse points of a capture that at least two photos observe, with covariances from their residuals.

        Args:
            cameras: of the views that the observations index.
        """
        order = np.lexsort((sparse.observations[:, 1], sparse.observations[:, 0]))
        point, photos = sparse.observations[order].T
        n_views = np.bincount(point, minlength=len(sparse.positions))
        is_used = n_views >= 2
        if not is_used.any():
            return cls.none("no sparse point is observed by two photos")
        kept = is_used[point]
        return _with_covariances(
            cameras, sparse.positions[is_used], n_views[is_used], photos[kept], sparse.pixels[order][kept],
            np.ones(int(kept.sum())), sparse.colors[is_used],
        )  # fmt: skip

    def __len__(self) -> int:
        return len(self.positions)

    def joined(self, other: "FeaturePoints") -> "FeaturePoints":
        """These points, then those of another set in the same photos."""
        names = ("positions", "covariance", "colors", "photos", "pixels", "residual")
        both = {name: np.concatenate([getattr(self, name), getattr(other, name)]) for name in names}
        return replace(
            self, **both, offsets=np.concatenate([self.offsets, self.offsets[-1] + other.offsets[1:]]), reason=""
        )

    @property
    def n_views(self) -> np.ndarray:
        """(p,) int: photos that show each point."""
        return np.diff(self.offsets)

    def sparse_points(self) -> SparsePoints:
        """The points as a capture's sparse points, which have no covariances."""
        point = np.repeat(np.arange(len(self)), self.n_views)
        return SparsePoints(self.positions, self.colors, np.column_stack([point, self.photos]), self.pixels, "own")


def points_of_tracks(
    cameras: Sequence[Camera],
    tracks: Tracks,
    found: Triangulated,
    pixels: np.ndarray,
    sigma: np.ndarray,
    colors: np.ndarray,
) -> FeaturePoints:
    """The points of the triangulated tracks, with covariances.

    With n observations of standard deviations s f, f known up to the common factor s, a point's residuals r have 2 n - 3
    degrees of freedom, and s^2 = sum |r / f|^2 / sum (2 n - 3). The covariance is v (sum J^T J / f^2)^-1, where v is the
    point's own estimate of s^2, drawn to the common one as if that were `PRIOR_FREEDOM` further degrees of freedom.

    Args:
        pixels: (o, 2) float, px, of the tracks' observations. sigma: (o,) float: f. colors: (o, 3) uint8.
    """
    if not found.is_good.any():
        return FeaturePoints.none("no track's rays meet in one point; check the cameras")
    track = np.repeat(np.arange(len(tracks)), np.diff(tracks.offsets))[found.kept]
    photos, pixels, colors, sigma = (of_all[found.kept] for of_all in (tracks.photos, pixels, colors, sigma))
    positions, n_views = found.positions[found.is_good], np.bincount(track, minlength=len(tracks))[found.is_good]
    starts = np.concatenate([[0], np.cumsum(n_views)])[:-1]
    mean_color = np.add.reduceat(colors.astype(float), starts) / n_views[:, None]
    return _with_covariances(cameras, positions, n_views, photos, pixels, sigma, np.round(mean_color).astype(np.uint8))


def _with_covariances(
    cameras: Sequence[Camera],
    positions: np.ndarray,
    n_views: np.ndarray,
    photos: np.ndarray,
    pixels: np.ndarray,
    sigma: np.ndarray,
    colors: np.ndarray,
) -> FeaturePoints:
    """Points (p, 3) with covariances, from their observations (o,) in the order of the points; see `points_of_tracks`."""
    offsets = np.concatenate([[0], np.cumsum(n_views)])
    starts, row = offsets[:-1], np.repeat(np.arange(len(positions)), n_views)
    P = np.array([camera.image_from_world for camera in cameras])
    residual = np.linalg.norm(reprojection(P, positions[row], photos, pixels), axis=1)
    squares, freedom = np.add.reduceat((residual / sigma) ** 2, starts), 2 * n_views - 3
    common = squares.sum() / freedom.sum()
    variance = (PRIOR_FREEDOM * common + squares) / (PRIOR_FREEDOM + freedom)
    covariance = variance[:, None, None] * np.linalg.inv(information(P, positions, photos, sigma, starts, row))
    mean_residual = np.add.reduceat(residual, starts) / n_views
    return FeaturePoints(positions, covariance, colors, offsets, photos, pixels, mean_residual, float(np.sqrt(common)))
