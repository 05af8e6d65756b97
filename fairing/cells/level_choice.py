"""Choice of levels by blur: the first level of a run, and the fine levels near the truth."""

import numpy as np

from fairing.cells.visibility import Visibility, footprints
from fairing.options import FINE_BLUR, FairingOptions
from fairing.scene import Scene

FOOTPRINT_PER_BLUR = 12.0  # a face's height over sigma_smooth at the first level


def first_level(scene: Scene, vertices: np.ndarray, orientation: int, options: FairingOptions) -> int:
    """The first level whose blur suits the size of the faces in the photos.

    Args:
        vertices: (n, 3) float, world units: the start.
        orientation: see `fairing.cells.visibility.mesh_orientation`.
    """
    if options.schedule.first_level == "first":
        return 0
    return level_for_footprint(typical_footprint(scene, vertices, orientation, options), options)


def typical_footprint(scene: Scene, vertices: np.ndarray, orientation: int, options: FairingOptions) -> float:
    """Median over the faces of the height of each one's largest footprint, px; 0 if no photo sees a face.

    Args:
        vertices: (n, 3) float, world units.
        orientation: see `fairing.cells.visibility.mesh_orientation`.
    """
    seen = []
    for view in scene.views:
        outline = footprints(vertices, scene.mesh.faces, view.camera, orientation, options.visibility, 0.0)
        seen.append(np.where(outline.reason == Visibility.SEEN, outline.height, np.nan))
    heights = np.nanmax(np.array(seen), axis=0, initial=0.0)
    return float(np.median(heights[heights > 0])) if (heights > 0).any() else 0.0


def level_for_footprint(typical: float, options: FairingOptions) -> int:
    """The first level whose blur suits faces of a typical height in the photos.

    Args:
        typical: median height of the faces' footprints, px.
    """
    return _first_level_of_blur(typical / FOOTPRINT_PER_BLUR, options)


def first_fine_level(options: FairingOptions) -> int:
    """The first level whose blur is at most `FINE_BLUR`; the last level if there is none."""
    return _first_level_of_blur(FINE_BLUR, options)


def _first_level_of_blur(most: float, options: FairingOptions) -> int:
    """The first level whose blur is at most that, px; the last level if there is none."""
    return next((k for k, level in enumerate(options.levels) if level.blur <= most), options.n_levels - 1)
