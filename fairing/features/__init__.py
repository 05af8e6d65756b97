"""Feature points: sparse points triangulated from photos with known cameras; no mesh is needed.

The steps in the order of a run: `keypoints` (SIFT), `pairs` of photos, `matching` along epipolar lines, `tracks`,
`triangulation`, `points` (the result, with covariances); `find` runs them. `surface_sweep`
finds further points near a mesh.

The modules import the shared data of `fairing` (cameras, photos, meshes) and `fairing.geometry`. Files of points:
`fairing.io.feature_points`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
