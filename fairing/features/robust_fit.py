"""Robust fit: the vertices of a start mesh moved towards feature points.

Minimises the sum of the Geman-McClure losses of the points' distances from the planes of their faces, with the loss's
turning point (the gate) annealed, and a Gaussian prior at the start. A point belongs to the face that the photos of the
point see in its direction, found by rays from their cameras, and not to the nearest face: points of ground and background
belong to none.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import trimesh
from scipy.sparse import coo_array, eye_array
from scipy.sparse.linalg import splu

from fairing.camera import Camera
from fairing.features.points import FeaturePoints
from fairing.geometry.normals import face_normals, unit_normals
from fairing.mesh import Mesh

GATES = (2.0, 1.5, 1.0, 0.8, 0.6, 0.4, 0.3, 0.2, 0.15, 0.1)
"""Percent of the mesh's diagonal."""
REACH = 3.0
"""Of the gate: points farther from their face's plane take no part."""
STEPS = 2
"""Gauss-Newton steps at each gate; each assigns the points anew."""
NEAR_GATE, NEAR_STEPS = 0.6, 1
"""Largest gate, and steps, of a fit that goes on from an earlier one (ledger: surface sweep: cost)."""
FARTHEST = 10.0
"""Percent of the diagonal: points farther from the face that their photos see belong to something else."""
POINT_SIGMA = 0.1
"""Percent of the diagonal: standard deviation of a point's distance from a flat face, beside the point's own."""
PRIOR_SIGMA = 0.7
"""Percent of the diagonal: largest standard deviation of a vertex's coordinate in the start, see `_prior_sigma`; scale of the loss
in `points_prefer`."""
DISPLACEMENT_QUANTILE, DISPLACEMENT_FACTOR = 0.9, 1.5
"""See `displacement`."""
VOTES = 0.5
"""Least share of a point's photos that see its face in its direction."""
RIM = 0.05
"""Barycentric: a point's foot may lie that far outside its face."""
JUDGING_SIGMA = 0.2
"""Percent of the diagonal: scale of the loss that compares a smoothed start with the start."""
HELD_BACK = 4
"""Every so many points the fit does not use; they judge it."""
LEAST_PART = 1 / 32
"""Of a vertex's way: a shorter one would leave a face folded over."""
GAIN = 0.1
"""Least share by which the mean loss of the points held back must fall; else the start is kept."""
CERTAINTY = 3.0
"""Least ratio of that fall to its standard error: chance does not move a mesh."""
JUDGED_POINTS = 3
"""Held back points around a vertex that can overrule the others."""


@dataclass(frozen=True, eq=False)
class Assignment:
    """Points with the faces they belong to.

    Attributes:
        points: (q,) int: the points that belong to a face.
        faces: (q,) int.
        weights: (q, 3) float: barycentric coordinates of each point's foot on its face's plane.
        normals: (q, 3) float: unit normals of the faces.
        distances: (q,) float, world units: from the plane to the point, positive along the normal.
    """

    points: np.ndarray
    faces: np.ndarray
    weights: np.ndarray
    normals: np.ndarray
    distances: np.ndarray


@dataclass(frozen=True, eq=False)
class RobustFit:
    """Attributes:
    vertices: (n, 3) float, world units: the fitted vertices; the start where points held back prefer it.
    start_error: world units: robust standard deviation of the points' distances from the start, 0 without points.
    assigned: points that belong to a face of the result.
    loss: mean loss of the same points held back, at the start and at `vertices`; NaN without such points.
    """

    vertices: np.ndarray
    start_error: float
    assigned: int
    loss: tuple[float, float]


def robust_fit(
    mesh: Mesh,
    cameras: Sequence[Camera],
    points: FeaturePoints,
    locked: np.ndarray | None = None,
    check: Callable[[], None] = lambda: None,
    begin: np.ndarray | None = None,
) -> RobustFit:
    """Move the vertices of a mesh towards feature points.

    A vertex keeps its place where points held back do not prefer the new one, and all do where these points gain too little.

    Args:
        cameras: of the photos that `points.photos` counts.
        locked: (n,) bool: vertices that never move; default: none.
        check: called before the points are assigned anew, some 30 times; may raise `Cancelled`.
        begin: (n, 3) float: an earlier fit of the mesh, from which this one goes on with the gates from `NEAR_GATE` on.
    """
    start, unit = mesh.vertices, mesh.diagonal / 100
    free = np.ones(len(start), dtype=bool) if locked is None else ~locked
    rays = _Rays(cameras, points, check)
    held_back, everything = held_back_points(points), np.ones(len(points), dtype=bool)
    sigma = _prior_sigma(rays.assign(mesh, FARTHEST * unit, ~held_back), unit)
    vertices, gates, steps = start, GATES, STEPS
    if begin is not None:
        vertices, gates, steps = begin, tuple(gate for gate in GATES if gate <= NEAR_GATE), NEAR_STEPS
    for gate in gates:
        for _ in range(steps):
            found = rays.assign(mesh.moved(vertices), REACH * gate * unit, ~held_back)
            vertices = _step(mesh, start, vertices, found, points.covariance, free, gate * unit, sigma, unit)
    vertices = _judged(mesh, _unfolded(mesh, vertices), rays, held_back, sigma, unit)
    before = rays.assign(mesh, GATES[0] * unit, everything)
    after = rays.assign(mesh.moved(vertices), GATES[0] * unit, everything)
    error = 1.4826 * float(np.median(np.abs(before.distances))) if len(before.points) else 0.0
    losses = _judging_losses(before, after, held_back, sigma)
    loss = (float(losses[0].mean()), float(losses[1].mean())) if losses.size else (float("nan"), float("nan"))
    if not _is_clearly_less(losses):
        return RobustFit(start, error, len(before.points), (loss[0], loss[0]))
    return RobustFit(vertices, error, len(after.points), loss)


def displacement(distances: np.ndarray) -> float:
    """How far the vertices of a mesh are from their true positions, by the distances (q,) of points from its faces.

    Most points lie inside faces, where the distance from the surface is less than that of the corners, and where the mesh is
    right they say nothing about the rest. Therefore it is a high quantile. (ledger: start error by points)
    """
    return DISPLACEMENT_FACTOR * float(np.quantile(distances, DISPLACEMENT_QUANTILE)) if len(distances) else 0.0


def held_back_points(points: FeaturePoints) -> np.ndarray:
    """(p,) bool: the points that the fit never uses."""
    return np.arange(len(points)) % HELD_BACK == HELD_BACK - 1


def held_back_loss(mesh: Mesh, cameras: Sequence[Camera], points: FeaturePoints) -> float:
    """Mean loss of the points held back, 0 to 1; a point that belongs to no face of the mesh costs 1.

    Args:
        cameras: of the photos that `points.photos` counts.
    """
    unit, judges = mesh.diagonal / 100, held_back_points(points)
    found = _Rays(cameras, points).assign(mesh, GATES[0] * unit, judges)
    return float(_losses(found, judges, JUDGING_SIGMA * unit)[judges].mean()) if judges.any() else 1.0


def points_prefer(before: Mesh, after: Mesh, cameras: Sequence[Camera], points: FeaturePoints) -> bool:
    """Whether the points clearly prefer the second of two states of a mesh: by a tenth of the loss and three standard errors.

    Args:
        cameras: of the photos that `points.photos` counts.
    """
    rays, everything, unit = _Rays(cameras, points), np.ones(len(points), dtype=bool), before.diagonal / 100
    found = [rays.assign(mesh, GATES[0] * unit, everything) for mesh in (before, after)]
    return _is_clearly_less(_judging_losses(found[0], found[1], everything, PRIOR_SIGMA * unit))


def distances_px(mesh: Mesh, cameras: Sequence[Camera], points: FeaturePoints) -> np.ndarray:
    """(q,) float, px: how far the photos show the points from the planes of their faces; of points that belong to one.

    The nearest of a point's photos counts, seen at a right angle: distance times focal length over depth.

    Args:
        cameras: of the photos that `points.photos` counts.
    """
    found = _Rays(cameras, points).assign(mesh, FARTHEST * mesh.diagonal / 100, np.ones(len(points), dtype=bool))
    focal, centers = (np.array(of_all) for of_all in zip(*((c.K[0, 0], c.center) for c in cameras), strict=True))
    point = np.repeat(np.arange(len(points)), points.n_views)
    depth = np.linalg.norm(points.positions[point] - centers[points.photos], axis=1)
    px_per_unit = np.zeros(len(points))
    np.maximum.at(px_per_unit, point, focal[points.photos] / depth)
    return np.abs(found.distances) * px_per_unit[found.points]


def points_on_surface(mesh: Mesh, cameras: Sequence[Camera], points: FeaturePoints) -> np.ndarray:
    """(p,) bool: the points that belong to a face: their own photos see it there, and it lies within a tenth of the diagonal."""
    result = np.zeros(len(points), dtype=bool)
    everything = np.ones(len(points), dtype=bool)
    result[_Rays(cameras, points).assign(mesh, FARTHEST * mesh.diagonal / 100, everything).points] = True
    return result


class _Rays:
    """The rays from the cameras of the photos that show the points."""

    def __init__(
        self, cameras: Sequence[Camera], points: FeaturePoints, check: Callable[[], None] = lambda: None
    ) -> None:
        self._check = check
        centers = np.array([camera.center for camera in cameras])
        self._positions, self._n_views = points.positions, points.n_views
        self._point = np.repeat(np.arange(len(points)), points.n_views)
        self._origins = centers[points.photos]
        self._directions = points.positions[self._point] - self._origins

    def assign(self, mesh: Mesh, reach: float, taking_part: np.ndarray) -> Assignment:
        """The points (p,) bool that take part, each with the face that most of its photos see in its direction.

        Args:
            reach: largest distance of a point from the plane of its face, world units.
        """
        self._check()
        shape = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        cast = np.flatnonzero(taking_part[self._point])
        hit = shape.ray.intersects_first(self._origins[cast], self._directions[cast])
        cast, hit = cast[hit >= 0], hit[hit >= 0]
        m = len(mesh.faces)
        candidates, votes = np.unique(self._point[cast] * m + hit, return_counts=True)
        point, face = candidates // m, candidates % m
        enough = votes >= VOTES * self._n_views[point]
        point, face, votes = point[enough], face[enough], votes[enough]
        corners = mesh.vertices[mesh.faces[face]]
        normals = unit_normals(mesh.vertices, mesh.faces)[0][face]
        distances = ((self._positions[point] - corners[:, 0]) * normals).sum(axis=1)
        feet = self._positions[point] - distances[:, None] * normals
        weights = trimesh.triangles.points_to_barycentric(corners, feet)
        kept = np.flatnonzero((np.abs(distances) < reach) & (weights.min(axis=1) > -RIM))
        # Of two faces with half of the photos each: the one the point is nearer to.
        kept = kept[np.lexsort((np.abs(distances[kept]), -votes[kept], point[kept]))]
        kept = kept[np.diff(point[kept], prepend=-1) > 0]
        return Assignment(point[kept], face[kept], weights[kept], normals[kept], distances[kept])


def _prior_sigma(found: Assignment, unit: float) -> float:
    """World units: standard deviation of a start's vertices, which the points measure (ledger: robust fit: measured prior)."""
    measured = displacement(np.abs(found.distances))
    return min(max(measured, POINT_SIGMA * unit), PRIOR_SIGMA * unit)


def _step(
    mesh: Mesh,
    start: np.ndarray,
    vertices: np.ndarray,
    found: Assignment,
    covariance: np.ndarray,
    free: np.ndarray,
    gate: float,
    prior_sigma: float,
    unit: float,
) -> np.ndarray:
    """(n, 3): one Gauss-Newton step of iteratively reweighted least squares; gate and prior_sigma in world units.

    A vertex's barycentric weight w and the normal n give d distance / d vertex = -w n.
    """
    n = len(vertices)
    robust = (gate**2 / (gate**2 + found.distances**2)) ** 2
    own = np.einsum("qi,qij,qj->q", found.normals, covariance[found.points], found.normals)
    information = robust / ((POINT_SIGMA * unit) ** 2 + own)
    prior = 1 / prior_sigma**2
    rows = found.weights[:, :, None] * found.normals[:, None, :]
    columns = 3 * mesh.faces[found.faces][:, :, None] + np.arange(3)
    index = (np.repeat(np.arange(len(rows)), 9), columns.ravel())
    J = coo_array((rows.ravel(), index), shape=(len(rows), 3 * n)).tocsr()
    H = (J.T @ J.multiply(information[:, None])).tocsc() + prior * eye_array(3 * n, format="csc")
    g = J.T @ (information * found.distances) + prior * (start - vertices).ravel()
    moving = np.flatnonzero(np.repeat(free, 3))
    step = np.zeros(3 * n)
    if len(moving):
        step[moving] = splu(H[:, moving][moving].tocsc()).solve(g[moving])
    return vertices + step.reshape(-1, 3)


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


def _judged(
    mesh: Mesh, vertices: np.ndarray, rays: _Rays, held_back: np.ndarray, sigma: float, unit: float
) -> np.ndarray:
    """(n, 3): the vertices, back at the start where the points held back around them prefer the start."""
    result, before = vertices.copy(), rays.assign(mesh, GATES[0] * unit, held_back)
    n = len(vertices)
    for _ in range(n):
        after = rays.assign(mesh.moved(result), GATES[0] * unit, held_back)
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
