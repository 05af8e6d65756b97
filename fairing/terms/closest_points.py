"""Term of the closest points: point-to-plane distances of sparse points from their closest face, with Huber's loss.

    sum_p rho(n . (sum_i w_pi v_i - x_p))

with the scale of the loss measured (1.4826 times the median absolute residual). Sparse points are measurements of the surface by
structure from motion. They correct a start that is far from the surface or spans a recess with a large face, where no texture is
within the basin of attraction of a vertex; where they agree with the photos, the photos are more accurate. Every second point is
used; reports are evaluated on the others. (ledger: fit to sparse points)
"""

from typing import NamedTuple

import numpy as np

from fairing.geometry.closest_point import SurfaceTree
from fairing.geometry.normals import unit_normals
from fairing.geometry.triangles import barycentric, closest_on_triangles
from fairing.mesh import Mesh
from fairing.optimize.loss import Huber
from fairing.optimize.rows import Anchor, Rows, Term
from fairing.terms.names import POINTS, START

MAX_DISTANCE = 0.5  # of a point to a face, in mean edges of the face: points farther away belong to other surfaces
MIN_COSINE = 0.5  # between face normal and direction to the point: others lie beyond the boundary of the mesh
# Precision of the anchor, relative to the mean diagonal of the normal matrix (ledger: regularization of the fit).
REGULARIZATION = 0.03


class Feet(NamedTuple):
    """Points with the closest point of a mesh each.

    Attributes:
        positions: (q, 3) float: of the points, world units.
        places: (q, 3) float: of the feet, world units.
        faces: (q,) int: of the feet.
        directions: (q, 3) float: unit vectors from the feet to the points; normals where both are the same.
        belong: (q,) bool: whether the point is taken to lie on the face: it is near it and in front of it.
        scale: world units: of Huber's loss of those, 1.4826 times their median distance.
    """

    positions: np.ndarray
    places: np.ndarray
    faces: np.ndarray
    directions: np.ndarray
    belong: np.ndarray
    scale: float


def feet_of(mesh: Mesh, points: np.ndarray, origin: np.ndarray) -> Feet:
    """The feet of points (p, 3) float, world units.

    Args:
        origin: (n, 3) float, world units: before the fit; edges there say how far a point may be from its face.
    """
    edges = origin[np.roll(mesh.faces, -1, axis=1)] - origin[mesh.faces]
    reach = MAX_DISTANCE * np.linalg.norm(edges, axis=2).mean(axis=1)
    distance, face = SurfaceTree(mesh).closest(points)
    places = closest_on_triangles(mesh.vertices[mesh.faces[face]], points)
    normals = unit_normals(mesh.vertices, mesh.faces)[0][face]
    # Beside an edge the direction to the point is no face's normal, and the same for both faces at the edge.
    equal = 1e-6 * float(reach.max(initial=1e-300))
    to_point = (points - places) / np.maximum(distance, 1e-300)[:, None]
    directions = np.where((distance > equal)[:, None], to_point, normals)
    belong = (distance < reach[face]) & (np.abs((directions * normals).sum(axis=1)) > MIN_COSINE)
    median = float(np.median(distance[belong])) if belong.any() else 0.0
    return Feet(points, places, face, directions, belong, max(1.4826 * median, equal))


def closest_points(mesh: Mesh, points: np.ndarray, origin: np.ndarray) -> Rows:
    """The term of points (p, 3) float, world units, whose closest faces are those of a mesh. Arguments as of `feet_of`."""
    feet = feet_of(mesh, points, origin)
    kept = feet.belong
    corners, directions = mesh.faces[feet.faces[kept]], feet.directions[kept]
    weights = barycentric(mesh.vertices[corners], feet.places[kept])
    residuals = ((feet.places - feet.positions)[kept] * directions).sum(axis=1)
    derivatives = weights[:, :, None] * directions[:, None, :]
    return Rows(POINTS, corners, derivatives, residuals, mesh.vertices, np.ones(len(residuals)), Huber(feet.scale))


def average_information(term: Term, vertices: np.ndarray, free: np.ndarray) -> float:
    """Mean diagonal element of the normal matrix of a term, of coordinates that it determines; 0 without any.

    Args:
        vertices: (n, 3) float, world units.
        free: (n,) bool: vertices that may move.
    """
    diagonal = np.einsum("vii->vi", term.hessians(vertices))[free]
    determined = diagonal[diagonal > 0]
    return float(determined.mean()) if len(determined) else 0.0


def anchor(origin: np.ndarray, average: float) -> Anchor:
    """What holds vertices (n, 3) to where they were before the fit, for points of an average information; 0: nothing else does."""
    return Anchor.uniform(START, REGULARIZATION * (average or 1.0), origin)
