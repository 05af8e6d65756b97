"""Fit of the mesh to sparse points of the capture.

Sparse points are measurements of the surface by structure from motion. They correct a start that is far from the surface or
spans a recess with a large face, where no texture is within the basin of attraction of a vertex; where they agree with the
photos, the photos are more accurate. Every second point is used for the fit; reports are evaluated on the others. (ledger:
fit to sparse points)
"""

import numpy as np
import trimesh
from scipy.sparse import coo_array, diags_array, eye_array
from scipy.sparse.linalg import splu

from fairing.features.points import FeaturePoints
from fairing.features.robust_fit import points_on_surface
from fairing.geometry.closest_point import SurfaceTree
from fairing.geometry.normals import unit_normals
from fairing.mesh import Mesh
from fairing.solve.normal_equations import QuadraticPrior
from fairing.solve.point_split import fitting_points
from fairing.solve.problem import Problem

MAX_DISTANCE = 0.5  # of a point to a face, in mean edges of the face: points farther away belong to other surfaces
MIN_COSINE = (
    0.5  # between the face normal and the direction to the point: other points lie beyond the boundary of the mesh
)
ROUNDING = 1e-6  # in units of the maximum distance: smaller residuals are equal
REGULARIZATION = (
    0.03  # towards the positions before the fit, relative to the mean diagonal of the normal matrix (ledger)
)


def fitted_to_points(
    problem: Problem, vertices: np.ndarray, rounds: int, near: FeaturePoints | None = None
) -> QuadraticPrior:
    """Fit of the vertices to every second point: iterative closest points with Huber's loss of point-to-plane distances.

    Args:
        vertices: (n, 3) float: positions, world units; a vertex without points nearby keeps its own.
        rounds: number of iterations; each assigns every point to its closest face.
        near: points of surface sweeps, which count like those of the capture (ledger: surface sweep).

    Returns:
        Prior with the fitted positions as targets. Its Hessians are the normal matrices of the points, relative to the mean
        of their diagonals: 1 in a direction that the points determine as well as an average coordinate.

    Raises:
        Cancelled: cancellation was requested.
    """
    mesh, points = problem.scene.mesh, _positions(problem, vertices, near)
    ids = np.flatnonzero(~problem.locked)
    columns = (3 * ids[:, None] + np.arange(3)).ravel()
    edges = vertices[np.roll(mesh.faces, -1, axis=1)] - vertices[mesh.faces]
    max_distance = MAX_DISTANCE * np.linalg.norm(edges, axis=2).mean(axis=1)
    places, average, hessians = vertices, 0.0, np.zeros((len(vertices), 3, 3))
    for _ in range(rounds):
        problem.raise_if_cancelled()
        corners, rows, residual = _residuals(mesh.moved(places), points, max_distance)
        scale = max(
            1.4826 * float(np.median(np.abs(residual))) if len(residual) else 0.0, ROUNDING * float(max_distance.max())
        )
        robust = 1 / np.maximum(1, np.abs(residual) / scale)
        index = (3 * corners[:, :, None] + np.arange(3)).ravel()
        J = coo_array(
            (rows.ravel(), (np.repeat(np.arange(len(rows)), 9), index)), shape=(len(rows), vertices.size)
        ).tocsc()[:, columns]
        H = (J.T @ diags_array(robust) @ J).tocsc()
        determined = H.diagonal()[H.diagonal() > 0]
        if len(determined) == 0:
            break
        average = average or float(determined.mean())
        regularization = REGULARIZATION * average
        gradient = J.T @ (robust * residual) + regularization * (places - vertices).ravel()[columns]
        steps = splu(H + regularization * eye_array(len(columns), format="csc")).solve(-gradient).reshape(-1, 3)
        steps, _ = problem.unfolded(places, ids, steps)
        places = places.copy()
        places[ids] += steps
        hessians = np.zeros((len(vertices), 3, 3))
        np.add.at(hessians, corners, robust[:, None, None, None] * rows[:, :, :, None] * rows[:, :, None, :])
    return QuadraticPrior(hessians / max(average, 1e-300), places)


def _positions(problem: Problem, vertices: np.ndarray, near: FeaturePoints | None) -> np.ndarray:
    """(p, 3) float: the fitting points on the surface with vertices (n, 3), or all of them if their photos are not known.

    Points of the ground and the background lie near the boundary of the mesh too, but their own photos do not see the mesh
    at their place.
    """
    observed = problem.observed_points
    if len(observed) == 0:
        return fitting_points(problem.scene)
    if near is not None:
        observed = observed.joined(near)
    cameras = [view.camera for view in problem.scene.views]
    return observed.positions[points_on_surface(problem.scene.mesh.moved(vertices), cameras, observed)]


def _residuals(mesh: Mesh, points: np.ndarray, max_distance: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Point-to-plane residuals of the points (p, 3) float that are within `max_distance` (m,) of their closest face.

    Returns:
        Vertices of the faces (q, 3) int, derivatives of the residuals with respect to them (q, 3, 3) float, and residuals
        (q,) float, world units.
    """
    distance, face = SurfaceTree(mesh).closest(points)
    near = distance < max_distance[face]
    distance, target, corners = distance[near, None], points[near], mesh.faces[face[near]]
    triangles = mesh.vertices[corners]
    foot = trimesh.triangles.closest_point(triangles, target)
    normals, _ = unit_normals(mesh.vertices, corners)
    # Beside an edge the direction to the point is no face's normal, and the same for both faces at the edge.
    to_point = (target - foot) / np.maximum(distance, 1e-300)
    direction = np.where(distance > ROUNDING * max_distance.max(initial=0), to_point, normals)
    in_front = np.abs((direction * normals).sum(axis=1)) > MIN_COSINE
    direction, triangles, foot = direction[in_front], triangles[in_front], foot[in_front]
    weights = trimesh.triangles.points_to_barycentric(triangles, foot)
    residual = ((foot - target[in_front]) * direction).sum(axis=1)
    return corners[in_front], weights[:, :, None] * direction[:, None, :], residual
