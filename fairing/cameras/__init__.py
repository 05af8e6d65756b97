"""Cameras: poses and intrinsics corrected by bundle adjustment over points found in photos, and the decision whether to use them.

In the order of a refinement: `pose_model` (parameters of a photo and derivatives of pixels), `observed_points`, `adjustment`
(the objective, its normal equations and steps; their loops are in `compiled`), `misfits` (single wrong cameras), `estimation`
(standard deviations from the residuals), `judge` (held-out points), `lens_trial` (photos that look distorted),
`corrected_scene`, `refinement` (`refine`, the whole).

Imports the data modules of `fairing`, `fairing.optimize` and `fairing.features`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
