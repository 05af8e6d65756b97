"""Options of feature points: detection, matching and triangulation."""

from dataclasses import dataclass


@dataclass(frozen=True)
class FeatureOptions:
    """How feature points are found. The defaults and their alternatives are in the ledger (rows: feature points).

    Attributes:
        contrast: least contrast of a keypoint, a fraction of the grey range (OpenCV's `contrastThreshold`).
        max_megapixels: larger photos are reduced to this size before detection. Detection needs about 250 MB a megapixel.
        neighbors: photos that each photo is matched with, the nearest ones.
        axis_angle: largest angle of the optical axes of two matched photos, degrees.
        epipolar_distance: largest distance of a candidate from its epipolar line, px, in both photos.
        ratio: largest ratio of the descriptor distances of the best and the second best candidate.
        residual: largest reprojection residual of an observation, px.
        views: least number of photos that see a point.
        angle: least angle between the two most different rays to a point, degrees.
    """

    contrast: float = 0.012
    max_megapixels: float = 4.0
    neighbors: int = 6
    axis_angle: float = 50.0
    epipolar_distance: float = 1.5
    ratio: float = 0.85
    residual: float = 1.0
    views: int = 3
    angle: float = 4.0
