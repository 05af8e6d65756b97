"""Fits of a mesh without photos: gates, axes, closest points, with the terms and the iterations of a run."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from fairing.camera import Camera
from fairing.features.points import FeaturePoints
from fairing.mesh import Mesh
from fairing.optimize.iteration import Guard, iterate
from fairing.optimize.rows import Anchor, Term
from fairing.options import StepOptions
from fairing.run.fits import points_on_mesh
from fairing.run.stages import AXES_ITERATIONS, ROUNDS
from fairing.solve.problem import Problem
from fairing.solve.step_limits import unfolded
from fairing.terms.axes import broad_terms, narrow_terms
from fairing.terms.closest_points import anchor, average_information, closest_points
from fairing.terms.names import POINTS
from fairing.terms.point_rays import Assignment, PointRays
from fairing.terms.points import GATES, PointFit


def guard_of(start: np.ndarray, faces: np.ndarray) -> Guard:
    """The guard of a run that starts with vertices (n, 3)."""
    return partial(unfolded, start=start, faces=faces, options=StepOptions())


class FitOfPoints(NamedTuple):
    """Attributes:
    vertices: (n, 3) float.
    sigma: world units, of the prior.
    assigned: points that belong to a face of the result.
    start_error: world units: robust standard deviation of the points' distances from the start, 0 without points.
    loss: mean Geman-McClure loss of the same points, at the start and at `vertices`; NaN without such points.
    """

    vertices: np.ndarray
    sigma: float
    assigned: int
    start_error: float
    loss: tuple[float, float]


def fit_of_points(
    mesh: Mesh,
    cameras: Sequence[Camera],
    points: FeaturePoints,
    locked: np.ndarray | None = None,
    sigma: float | None = None,
) -> FitOfPoints:
    """A mesh after all gates.

    Args:
        locked: (n,) bool; default: none.
        sigma: of the prior, world units; default: as the points measure it.
    """
    unit, guard = mesh.diagonal / 100, guard_of(mesh.vertices, mesh.faces)
    rays = PointRays(cameras, points)
    fit = PointFit(mesh, rays, points.covariance)
    fit.sigma = fit.sigma if sigma is None else sigma
    ids = np.arange(len(mesh.vertices)) if locked is None else np.flatnonzero(~locked)
    vertices = mesh.vertices
    for gate in GATES:
        vertices = iterate(fit.terms(vertices, gate), vertices, ids, guard).after
    before, after = (rays.assign(each, max(GATES) * unit) for each in (mesh, mesh.moved(vertices)))
    error = 1.4826 * float(np.median(np.abs(before.distances))) if len(before.points) else 0.0
    judges = np.union1d(before.points, after.points)
    losses = [
        np.mean([_loss(found, p, fit.sigma) for p in judges]) if len(judges) else np.nan for found in (before, after)
    ]
    return FitOfPoints(vertices, fit.sigma, len(after.points), error, (float(losses[0]), float(losses[1])))


def _loss(found: Assignment, point: int, sigma: float) -> float:
    """Of one point, 0 to 1; 1 if it belongs to no face."""
    distance = found.distances[found.points == point]
    return float(distance[0] ** 2 / (sigma**2 + distance[0] ** 2)) if len(distance) else 1.0


def closest_fit(problem: Problem, vertices: np.ndarray, rounds: int) -> Anchor:
    """Vertices (n, 3) after some rounds of closest points, with the Hessians of the points in the last one."""
    points, free, places = (
        points_on_mesh(problem.scene, problem.observed_points, vertices, None),
        ~problem.locked,
        vertices,
    )
    hessians = np.zeros((len(vertices), 3, 3))
    for _ in range(rounds):
        closest = closest_points(problem.scene.mesh.moved(places), points, vertices)
        average = average_information(closest, places, free)
        hessians = closest.hessians(places) / max(average, 1e-300)
        terms = closest, anchor(vertices, average)
        places = iterate(terms, places, np.flatnonzero(free), problem.unfolded).after
    return Anchor(POINTS, hessians, places)


def straightened(vertices: np.ndarray, faces: np.ndarray, locked: np.ndarray, pixel: np.ndarray) -> np.ndarray:
    """(n, 3) float: vertices after the narrow relations of a run; arguments as of `narrow_terms`, locked (n,) bool."""
    return _converged(lambda places, _: narrow_terms(places, faces, pixel), 1, vertices, faces, locked, pixel)


def straightened_from_afar(
    vertices: np.ndarray,
    faces: np.ndarray,
    locked: np.ndarray,
    pixel: np.ndarray,
    information: np.ndarray,
    error: float,
) -> np.ndarray:
    """(n, 3) float: vertices after the broad relations of a run; arguments as of `broad_terms`, locked (n,) bool."""

    def terms(places: np.ndarray, sweep: int) -> tuple[Term, ...]:
        return broad_terms(places, faces, pixel, information, error, error * 0.5**sweep, vertices)

    return _converged(terms, ROUNDS, vertices, faces, locked, pixel)


def _converged(
    terms: Callable[[np.ndarray, int], tuple[Term, ...]],
    sweeps: int,
    vertices: np.ndarray,
    faces: np.ndarray,
    locked: np.ndarray,
    pixel: np.ndarray,
) -> np.ndarray:
    ids, guard, places = np.flatnonzero(~locked & np.isfinite(pixel)), guard_of(vertices, faces), vertices
    for sweep in range(sweeps):
        of_sweep = terms(places, sweep)
        for _ in range(AXES_ITERATIONS):
            places = iterate(of_sweep, places, ids, guard).after
    return places
