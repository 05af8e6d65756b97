"""Term of the axes: the Manhattan frame of a mesh, the three orthogonal directions that most edges of a building follow
(Coughlan, Yuille, ICCV 1999).

Where the edges of a mesh show that it has such axes, edges nearly parallel to one and faces nearly perpendicular to one are
taken to be exactly so: a prior that helps where photos show little, as at corners that slide along a wall, and that keeps
neighbouring edges from being aligned with the same line of a photo. Meshes of other things have no such axes, or their edges do
not follow them: then there are no relations. (ledger: Manhattan frame)
"""

from typing import NamedTuple

import numpy as np

from fairing.geometry.normals import unit_normals
from fairing.optimize.loss import GemanMcClure
from fairing.optimize.rows import Anchor, Rows, Term
from fairing.terms.names import AXES, START

ANGLE = 8.0  # degrees: edges and normals within it of an axis may follow it; normals of a wall within it of their mean are one
LEAST_EDGES, LEAST_PART = 8, 0.5  # long edges within `ANGLE` of an axis, and the part of them that must follow it
SCALE = 3.0  # px: of the Geman-McClure loss of the relations; shorter edges tell nothing about an axis
ITERATIONS = 12  # of mean shift, and of expectation maximization
# Of vertices that are far off: an edge may deviate from an axis by twice their error, and that is twice their standard deviation.
FAR = 2.0  # (ledger: broad relations: rounds, deviations)
FAR_INFORMATION = 5.0  # 1 / px^2: of points that determine a direction as well as an average one


class Relations(NamedTuple):
    """Pairs of vertices that have the same coordinate along a direction.

    Attributes:
        pairs: (r, 2) int: vertex ids.
        directions: (r, 3) float, px per world unit.
    """

    pairs: np.ndarray
    directions: np.ndarray


def relations(vertices: np.ndarray, faces: np.ndarray, pixel: np.ndarray, error: float = 0.0) -> Relations:
    """The relations between the ends of edges that follow an axis and the corners of faces perpendicular to one.

    Args:
        vertices: (n, 3) float, world units.
        faces: (m, 3) int.
        pixel: (n,) float: size of a pixel, world units; NaN for vertices that take no part.
        error: px: how far vertices may be off; short edges may deviate from an axis accordingly.
    """
    faces = faces[np.isfinite(pixel[faces]).all(axis=1)]
    pairs, directions = [np.zeros((0, 2), dtype=int)], [np.zeros((0, 3))]
    edges = np.unique(np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)
    edge_pixel, face_pixel = pixel[edges].mean(axis=1), pixel[faces].mean(axis=1)
    across = (vertices[edges[:, 1]] - vertices[edges[:, 0]]) / edge_pixel[:, None]
    normals, area = unit_normals(vertices, faces)
    frame = _frame(normals, area)
    for k, axis in enumerate(frame):
        if not _is_followed(across, axis):
            continue
        along = _is_near(across, axis, error)
        for other in np.delete(frame, k, axis=0):
            pairs.append(edges[along])
            directions.append(other / edge_pixel[along, None])
        facing = _is_near(normals, axis)
        for side in ([0, 1], [1, 2], [2, 0]):
            pairs.append(faces[facing][:, side])
            directions.append(axis / face_pixel[facing, None])
    return Relations(np.concatenate(pairs), np.concatenate(directions))


def related(found: Relations, vertices: np.ndarray, scale: float = SCALE) -> Rows:
    """The term of relations: differences of coordinates, px, with the Geman-McClure loss at a scale, px.

    Args:
        vertices: (n, 3) float, world units.
    """
    derivatives = np.stack([-found.directions, found.directions], axis=1)
    residuals = np.einsum("rci,rci->r", derivatives, vertices[found.pairs])
    information = np.full(len(residuals), (SCALE / scale) ** 2)
    return Rows(AXES, found.pairs, derivatives, residuals, vertices, information, GemanMcClure(scale))


def narrow_terms(vertices: np.ndarray, faces: np.ndarray, pixel: np.ndarray) -> tuple[Term, ...]:
    """Relations of vertices near their true positions; a pixel of a move weighs as much as one of a difference.

    Args:
        vertices: (n, 3) float, world units.
        faces: (m, 3) int.
        pixel: (n,) float, see `relations`.
    """
    return related(relations(vertices, faces, pixel), vertices), Anchor.uniform(START, _finite(pixel) ** -2.0, vertices)


def broad_terms(
    vertices: np.ndarray,
    faces: np.ndarray,
    pixel: np.ndarray,
    information: np.ndarray,
    error: float,
    within: float,
    origin: np.ndarray,
) -> tuple[Term, ...]:
    """Relations of vertices that points do not determine: those are as far off as they began.

    Edges that follow an axis deviate from it accordingly: relations are sought within the error, which falls by half from
    sweep to sweep. (ledger: broad relations)

    Args:
        vertices: (n, 3) float, world units: fitted to points.
        faces: (m, 3) int.
        pixel: (n,) float, see `relations`.
        information: (n, 3, 3) float: what the points determine, 1 in a direction that they determine as well as an average one.
        error: px: distance of the vertices from their true positions before they were fitted; 0 if it is not known.
        within: px: the part of it that this sweep allows for.
        origin: (n, 3) float, world units: before the first of these sweeps.
    """
    own = FAR_INFORMATION * information + np.eye(3) / max(error / FAR, 1.0) ** 2
    precision = own / _finite(pixel)[:, None, None] ** 2
    found = relations(vertices, faces, pixel, within)
    return related(found, vertices, max(within, SCALE)), Anchor(START, precision, origin)


def _finite(pixel: np.ndarray) -> np.ndarray:
    """(n,) float: sizes of a pixel; 1 for vertices that take no part."""
    return np.where(np.isfinite(pixel), pixel, 1.0)


def _frame(normals: np.ndarray, area: np.ndarray) -> np.ndarray:
    """(3, 3) float: orthogonal unit vectors as rows, from the walls with the largest areas; (0, 3) where all face one way.

    The normals of the 60 largest faces are tried.

    Args:
        normals: (m, 3) float: unit normals of the faces.
        area: (m,) float: their areas, in any unit.
    """
    walls = normals[np.argsort(-area, kind="stable")[:60]]
    part = np.zeros((len(walls), len(normals)))
    for _ in range(ITERATIONS):
        cosine = walls @ normals.T
        part = area * (np.abs(cosine) > np.cos(np.radians(ANGLE)))
        walls = (part * np.sign(cosine)) @ normals
        walls /= np.maximum(np.linalg.norm(walls, axis=1, keepdims=True), 1e-300)
    walls = walls[np.argsort(-part.sum(axis=1), kind="stable")]
    first = walls[:1]
    beside = walls[(np.abs(walls @ first.T) < np.sin(np.radians(ANGLE))).all(axis=1)]
    if len(beside) == 0:
        return np.zeros((0, 3))
    first, second = first[0], beside[0] - (beside[0] @ first[0]) * first[0]
    second /= np.linalg.norm(second)
    return np.stack([first, second, np.cross(first, second)])


def _is_near(vectors: np.ndarray, axis: np.ndarray, error: float = 0.0) -> np.ndarray:
    """(k,) bool: vectors (k, 3) within `ANGLE` of an axis, in either direction, or as near as an error lets them be.

    No farther than 45 degrees: beyond, another axis is nearer.
    """
    length, along = np.linalg.norm(vectors, axis=1), np.abs(vectors @ axis)
    deviation = np.sqrt(np.maximum(length**2 - along**2, 0))
    return ((deviation < along) & (deviation < FAR * error)) | (along > np.cos(np.radians(ANGLE)) * length)


def _is_followed(edges: np.ndarray, axis: np.ndarray) -> bool:
    """Whether most long edges (e, 3), px, near an axis follow it.

    Those that do deviate by the errors of their ends, with a standard deviation of 1 px, others by anything within `ANGLE`: the
    part of the former is estimated by expectation maximization.
    """
    near = edges[_is_near(edges, axis) & (np.linalg.norm(edges, axis=1) > SCALE)]
    if len(near) < LEAST_EDGES:
        return False
    length = np.linalg.norm(near, axis=1)
    deviation, widest = length**2 - (near @ axis) ** 2, (length * np.sin(np.radians(ANGLE))) ** 2  # px^2
    follows = np.exp(-deviation / 2) / (2 * (1 - np.exp(-widest / 2)))
    other, part = 1 / widest, 0.5
    for _ in range(ITERATIONS):
        part = float((part * follows / (part * follows + (1 - part) * other)).mean())
    return part >= LEAST_PART
