"""Feature points: sparse points triangulated from photos with known cameras; no mesh is needed.

The steps in the order of a run: `keypoints` (SIFT), `pairs` of photos, `matching` along epipolar lines, `tracks`,
`triangulation`, `points` (the result, with covariances). `find` runs them, `store` keeps the result in a file.

This room imports cameras, photos, scenes and files. It imports nothing of meshes, cells or the solver.
"""

from typing import TYPE_CHECKING

from fairing.on_demand import on_demand

if TYPE_CHECKING:
    from fairing.features.find import find_points
    from fairing.features.options import FeatureOptions
    from fairing.features.ply import write_points_ply
    from fairing.features.points import FeaturePoints
    from fairing.features.store import find_points_once, load_points, save_points

__all__ = [
    "FeatureOptions",
    "FeaturePoints",
    "find_points",
    "find_points_once",
    "load_points",
    "save_points",
    "write_points_ply",
]

__getattr__ = on_demand(
    __name__,
    {
        "FeatureOptions": "fairing.features.options",
        "FeaturePoints": "fairing.features.points",
        "find_points": "fairing.features.find",
        "find_points_once": "fairing.features.store",
        "load_points": "fairing.features.store",
        "save_points": "fairing.features.store",
        "write_points_ply": "fairing.features.ply",
    },
)
