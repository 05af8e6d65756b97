"""Feature points: sparse points triangulated from photos with known cameras; no mesh is needed.

The steps in the order of a run: `keypoints` (SIFT), `pairs` of photos, `matching` along epipolar lines, `tracks`,
`triangulation`, `points` (the result, with covariances); `find` runs them. `robust_fit` moves a start mesh towards the points.
`surface_sweep` finds further points near a mesh.

The modules import the shared data of `fairing` (cameras, photos, meshes) and `fairing.geometry`. Files of points:
`fairing.io.feature_points`.
"""

from typing import TYPE_CHECKING

from fairing.util.on_demand import on_demand

if TYPE_CHECKING:
    from fairing.features.find import find_points
    from fairing.features.options import FeatureOptions
    from fairing.features.points import FeaturePoints

__all__ = [
    "FeatureOptions",
    "FeaturePoints",
    "find_points",
]

__getattr__ = on_demand(
    __name__,
    {
        "FeatureOptions": "fairing.features.options",
        "FeaturePoints": "fairing.features.points",
        "find_points": "fairing.features.find",
    },
)
