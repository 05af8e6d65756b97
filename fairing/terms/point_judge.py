"""Judges by sparse points: which of two states of a mesh lies nearer to them."""

from collections.abc import Sequence

import numpy as np

from fairing.camera import Camera
from fairing.features.points import FeaturePoints
from fairing.mesh import Mesh
from fairing.terms.point_rays import Assignment, PointRays
from fairing.terms.points import GATES, PRIOR_SIGMA

CERTAINTY = 3.0
"""Least ratio of the fall of the points' mean loss to its standard error: chance does not move a mesh."""


def loss_of_points(mesh: Mesh, cameras: Sequence[Camera], points: FeaturePoints) -> float:
    """Mean loss of points, 0 to 1; one that belongs to no face of the mesh costs 1.

    Args:
        cameras: of the photos that `points.photos` counts.
    """
    unit = mesh.diagonal / 100
    found = PointRays(cameras, points).assign(mesh, max(GATES) * unit)
    return float(_losses(found, len(points), PRIOR_SIGMA * unit).mean()) if len(points) else 1.0


def points_prefer(before: Mesh, after: Mesh, cameras: Sequence[Camera], points: FeaturePoints) -> bool:
    """Whether points clearly prefer the second of two states of a mesh: by three standard errors of their loss.

    Those judge that belong to a face of either state.

    Args:
        cameras: of the photos that `points.photos` counts.
    """
    rays, unit = PointRays(cameras, points), before.diagonal / 100
    found = [rays.assign(mesh, max(GATES) * unit) for mesh in (before, after)]
    judges = np.union1d(found[0].points, found[1].points)
    if len(judges) < 2:
        return False
    losses = [_losses(each, len(points), PRIOR_SIGMA * unit)[judges] for each in found]
    gain = losses[0] - losses[1]
    return bool(gain.mean() > CERTAINTY * gain.std() / np.sqrt(len(gain)))


def _losses(found: Assignment, count: int, sigma: float) -> np.ndarray:
    """(count,) float: Geman-McClure loss at sigma, world units, of each point; 1, the largest, without a face."""
    result = np.ones(count)
    result[found.points] = found.distances**2 / (sigma**2 + found.distances**2)
    return result
