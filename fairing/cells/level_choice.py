"""At which level a run begins: no coarser than its faces allow."""

import numpy as np

from fairing.cells.visibility import Visibility, footprints
from fairing.options import FairingOptions
from fairing.scene import Scene

FOOTPRINT_PER_BLUR = 12.0  # a face's height over sigma_smooth at the first level
NEAR_TRUTH_BLUR = 1.2  # px


def first_level(scene: Scene, vertices: np.ndarray, orientation: int, options: FairingOptions) -> int:
    """The first level whose blur suits the size of the faces in the photos.

    Args:
        vertices: (n, 3) float: the start.
        orientation: see `fairing.cells.context.facing`.
    """
    if options.schedule.start == "first":
        return 0
    seen = []
    for view in scene.views:
        outline = footprints(vertices, scene.mesh.faces, view.camera, orientation, options.visibility, 0.0)
        seen.append(np.where(outline.reason == Visibility.SEEN, outline.height, np.nan))
    heights = np.nanmax(np.array(seen), axis=0, initial=0.0)
    return level_for_footprint(float(np.median(heights[heights > 0])) if (heights > 0).any() else 0.0, options)


def level_for_footprint(typical: float, options: FairingOptions) -> int:
    """The first level whose blur suits faces of a typical height in the photos, px."""
    fitting = (k for k, blur in enumerate(options.schedule.blur) if blur <= typical / FOOTPRINT_PER_BLUR)
    return next(fitting, options.n_levels - 1)


def first_fine_level(options: FairingOptions) -> int:
    """The first level fine enough to tell near the truth."""
    fine = (k for k, blur in enumerate(options.schedule.blur) if blur <= NEAR_TRUTH_BLUR)
    return next(fine, options.n_levels - 1)


def last_fine_level(options: FairingOptions) -> int:
    """The last level of the blur that the first fine one has."""
    blur = options.schedule.blur[first_fine_level(options)]
    return max(k for k in range(options.n_levels) if options.schedule.blur[k] == blur)
