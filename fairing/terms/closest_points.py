"""Term of the closest points: point-to-plane distances of sparse points from their closest face, with Huber's loss.

    sum_p rho(n . (sum_i w_pi v_i - x_p))

with the scale of the loss measured (1.4826 times the median absolute residual). Sparse points are measurements of the surface by
structure from motion. They correct a start that is far from the surface or spans a recess with a large face, where no texture is
within the basin of attraction of a vertex; where they agree with the photos, the photos are more accurate. Every second point is
used; reports are evaluated on the others. (ledger: fit to sparse points)
"""

import numpy as np

from fairing.geometry.closest_point import SurfaceTree
from fairing.geometry.normals import unit_normals
from fairing.geometry.triangles import barycentric, closest_on_triangles
from fairing.mesh import Mesh
from fairing.optimize.loss import Huber
from fairing.optimize.rows import Anchor, Rows
from fairing.terms.names import POINTS, START

MAX_DISTANCE = 0.5  # of a point to a face, in mean edges of the face: points farther away belong to other surfaces
MIN_COSINE = (
    0.5  # between the face normal and the direction to the point: other points lie beyond the boundary of the mesh
)
ROUNDING = 1e-6  # in units of the maximum distance: smaller residuals are equal
REGULARIZATION = 0.03  # precision of the anchor, relative to the mean diagonal of the normal matrix (ledger)


def closest_points(mesh: Mesh, points: np.ndarray, origin: np.ndarray) -> Rows:
    """The term of points (p, 3) float, world units, whose closest faces are those of a mesh.

    Args:
        origin: (n, 3) float, world units: before the fit; edges there say how far a point may be from its face.
    """
    edges = origin[np.roll(mesh.faces, -1, axis=1)] - origin[mesh.faces]
    max_distance = MAX_DISTANCE * np.linalg.norm(edges, axis=2).mean(axis=1)
    corners, derivatives, residuals = _residuals(mesh, points, max_distance)
    measured = 1.4826 * float(np.median(np.abs(residuals))) if len(residuals) else 0.0
    loss = Huber(max(measured, ROUNDING * float(max_distance.max(initial=1e-300))))
    return Rows(POINTS, corners, derivatives, residuals, mesh.vertices, np.ones(len(residuals)), loss)


def average_information(points: Rows, vertices: np.ndarray, free: np.ndarray) -> float:
    """Mean diagonal element of the normal matrix of points, 1 / world unit^2, of coordinates that they determine; 0 without any.

    Args:
        vertices: (n, 3) float, world units.
        free: (n,) bool: vertices that may move.
    """
    diagonal = np.einsum("vii->vi", points.hessians(vertices))[free]
    determined = diagonal[diagonal > 0]
    return float(determined.mean()) if len(determined) else 0.0


def anchor(origin: np.ndarray, average: float) -> Anchor:
    """What holds vertices (n, 3) to where they were before the fit, for points of an average information; 0: nothing else does."""
    precision = REGULARIZATION * (average or 1.0) * np.eye(3)
    return Anchor(START, np.tile(precision, (len(origin), 1, 1)), origin)


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
    foot = closest_on_triangles(triangles, target)
    normals, _ = unit_normals(mesh.vertices, corners)
    # Beside an edge the direction to the point is no face's normal, and the same for both faces at the edge.
    to_point = (target - foot) / np.maximum(distance, 1e-300)
    direction = np.where(distance > ROUNDING * max_distance.max(initial=0), to_point, normals)
    in_front = np.abs((direction * normals).sum(axis=1)) > MIN_COSINE
    direction, triangles, foot = direction[in_front], triangles[in_front], foot[in_front]
    weights = barycentric(triangles, foot)
    residual = ((foot - target[in_front]) * direction).sum(axis=1)
    return corners[in_front], weights[:, :, None] * direction[:, None, :], residual
