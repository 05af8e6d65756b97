"""Start error: the distance of the start's vertices from their true positions, by sparse points."""

import numpy as np

from fairing.solve.problem import Problem
from fairing.terms.point_rays import displacement, distances_px

FAR_ERROR = 3.0
"""px: Gauss-Newton reaches that far at coarse levels alone (ledger: level after a fit, one surface sweep)."""


def measured_start_error(problem: Problem, start: np.ndarray) -> float:
    """Distance of the start's vertices from their true positions, px, by the observed sparse points; 0 without points.

    Args:
        start: (n, 3) float: positions of the vertices, world units.
    """
    cameras = [view.camera for view in problem.scene.views]
    return displacement(distances_px(problem.scene.mesh.moved(start), cameras, problem.observed_points))
