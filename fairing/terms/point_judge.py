"""Judges of a fit: points that no fit uses."""

from collections.abc import Sequence

import numpy as np

from fairing.camera import Camera
from fairing.features.points import FeaturePoints
from fairing.geometry.normals import face_normals
from fairing.mesh import Mesh
from fairing.terms.point_rays import Assignment, PointRays
from fairing.terms.points import PRIOR_SIGMA

WIDEST = 2.0
"""Percent of the diagonal: points farther from their face judge nothing."""
HELD_BACK = 4
"""Every so many points the fit does not use; they judge it."""
JUDGING_SIGMA = 0.2
"""Percent of the diagonal: scale of the loss that compares a smoothed start with the start."""
LEAST_PART = 1 / 32
"""Of a vertex's way: a shorter one would leave a face folded over."""
GAIN = 0.1
"""Least share by which the mean loss of the points held back must fall; else the start is kept."""
CERTAINTY = 3.0
"""Least ratio of that fall to its standard error: chance does not move a mesh."""
JUDGED_POINTS = 3
"""Held back points around a vertex that can overrule the others."""


def held_back_points(points: FeaturePoints) -> np.ndarray:
    """(p,) bool: the points that the fit never uses."""
    return np.arange(len(points)) % HELD_BACK == HELD_BACK - 1


def held_back_loss(mesh: Mesh, cameras: Sequence[Camera], points: FeaturePoints) -> float:
    """Mean loss of the points held back, 0 to 1; a point that belongs to no face of the mesh costs 1.

    Args:
        cameras: of the photos that `points.photos` counts.
    """
    unit, judges = mesh.diagonal / 100, held_back_points(points)
    found = PointRays(cameras, points).assign(mesh, WIDEST * unit, judges)
    return float(_losses(found, judges, JUDGING_SIGMA * unit)[judges].mean()) if judges.any() else 1.0


def points_prefer(before: Mesh, after: Mesh, cameras: Sequence[Camera], points: FeaturePoints) -> bool:
    """Whether the points clearly prefer the second of two states of a mesh: by a tenth of the loss and three standard errors.

    Args:
        cameras: of the photos that `points.photos` counts.
    """
    rays, everything, unit = PointRays(cameras, points), np.ones(len(points), dtype=bool), before.diagonal / 100
    found = [rays.assign(mesh, WIDEST * unit, everything) for mesh in (before, after)]
    return _is_clearly_less(_judging_losses(found[0], found[1], everything, PRIOR_SIGMA * unit))


def judged(start: Mesh, vertices: np.ndarray, rays: PointRays, held_back: np.ndarray, sigma: float) -> np.ndarray:
    """(n, 3) float: fitted vertices (n, 3), back at the start where the points held back prefer it.

    All of them go back where these points gain too little by the fit. (ledger: choice of the fit)

    Args:
        held_back: (p,) bool: points that the fit did not use.
        sigma: world units: scale of the loss that compares.
    """
    unit = start.diagonal / 100
    result = _judged_by_vertex(start, _unfolded(start, vertices), rays, held_back, sigma, unit)
    everything = np.ones(len(held_back), dtype=bool)
    found = [rays.assign(mesh, WIDEST * unit, everything) for mesh in (start, start.moved(result))]
    return result if _is_clearly_less(_judging_losses(found[0], found[1], held_back, sigma)) else start.vertices


def _unfolded(mesh: Mesh, vertices: np.ndarray) -> np.ndarray:
    """(n, 3): the vertices, those of faces whose normal has turned by more than a right angle drawn back to the start."""
    before, part = face_normals(mesh.vertices, mesh.faces), np.ones((len(vertices), 1))
    while True:
        result = mesh.vertices + part * (vertices - mesh.vertices)
        folded = (before * face_normals(result, mesh.faces)).sum(axis=1) < 0
        if not folded.any():
            return result
        back = np.unique(mesh.faces[folded])
        part[back] = np.where(part[back] > LEAST_PART, part[back] / 2, 0)


def _judged_by_vertex(
    mesh: Mesh, vertices: np.ndarray, rays: PointRays, held_back: np.ndarray, sigma: float, unit: float
) -> np.ndarray:
    """(n, 3): the vertices, back at the start where the points held back around them prefer the start."""
    result, before = vertices.copy(), rays.assign(mesh, WIDEST * unit, held_back)
    n = len(vertices)
    for _ in range(n):
        after = rays.assign(mesh.moved(result), WIDEST * unit, held_back)
        gain = _losses(before, held_back, sigma) - _losses(after, held_back, sigma)
        corners, point = (np.concatenate(both) for both in zip(*(
            (mesh.faces[found.faces].ravel(), np.repeat(found.points, 3)) for found in (before, after)
        ), strict=True))  # fmt: skip
        count = np.bincount(corners, minlength=n)
        total = np.bincount(corners, gain[point], minlength=n)
        back = (result != mesh.vertices).any(axis=1) & (count >= JUDGED_POINTS) & (total < 0)
        if not back.any():
            break
        result[back] = mesh.vertices[back]
    return _unfolded(mesh, result)


def _judging_losses(before: Assignment, after: Assignment, held_back: np.ndarray, sigma: float) -> np.ndarray:
    """(2, k) float: losses before and after of the same points: those held back that belong to a face before or after."""
    judges = np.union1d(before.points, after.points)
    judges = judges[held_back[judges]]
    return np.stack([_losses(found, held_back, sigma)[judges] for found in (before, after)])


def _is_clearly_less(losses: np.ndarray) -> bool:
    """Whether the mean of the second row (2, k) is less than the first's by `GAIN`, and by `CERTAINTY` standard errors."""
    gain = losses[0] - losses[1]
    if len(gain) < 2:
        return False
    return bool(gain.mean() > max(GAIN * losses[0].mean(), CERTAINTY * gain.std() / np.sqrt(len(gain))))


def _losses(found: Assignment, points: np.ndarray, sigma: float) -> np.ndarray:
    """(p,) float: Geman-McClure loss at sigma, world units, of each of `points` (p,); 1, the largest, without a face."""
    result = np.ones(len(points))
    result[found.points] = found.distances**2 / (sigma**2 + found.distances**2)
    return result
