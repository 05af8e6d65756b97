"""Surface of a cut: the facets between tetrahedra inside and outside, as an oriented two-manifold.

Where parts of the inside touch in an edge or a vertex only, the surface passes there several times; each pass gets a vertex of
its own.
"""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fairing.triangulation.tetrahedra import CORNERS, Tetrahedra


def cut_facets(mesh: Tetrahedra, is_outside: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The facets between tetrahedra inside and outside (T,) bool, without those at the box, in the order of `cut_surface`.

    Returns:
        (m,) int: the tetrahedron inside; and (m,) int: its corner opposite the facet.
    """
    bounds = ~is_outside[:, None] & is_outside[mesh.neighbours] & (mesh.neighbours >= 0)
    bounds &= (mesh.corners[:, CORNERS] < mesh.n_points).all(axis=2)
    tetrahedron, facet = np.nonzero(bounds)
    return tetrahedron, facet


def cut_surface(mesh: Tetrahedra, is_outside: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The surface between tetrahedra inside and outside, without facets at the box.

    Args:
        is_outside: (T,) bool.

    Returns:
        (m, 3) int: faces, counter-clockwise seen from outside, as ids of their own; and (n,) int: the point of each id.
    """
    tetrahedron, facet = cut_facets(mesh, is_outside)
    number = np.full(mesh.corners.shape, -1)
    number[tetrahedron, facet] = np.arange(len(facet))
    points = mesh.corners[tetrahedron[:, None], CORNERS[facet]]
    face = np.repeat(np.arange(len(points)), 3)
    a, b = points.ravel(), points[:, [1, 2, 0]].ravel()
    beside = number[_turned(mesh, is_outside, tetrahedron[face], facet[face], a, b)]
    corner = 3 * face + np.tile([0, 1, 2], len(points))
    ahead = 3 * face + np.tile([1, 2, 0], len(points))
    inner = beside >= 0  # not at a facet of the box
    joined = [3 * beside + np.argmax(points[beside] == end[:, None], axis=1) for end in (a, b)]
    faces, point = _numbered(
        points, *(np.concatenate([one[inner], two[inner]]) for one, two in ((corner, ahead), joined))
    )
    # A vertex whose faces pass an edge twice is split there, too.
    faces, former = split_at_vertices(faces)
    return faces, point[former]


def _turned(
    mesh: Tetrahedra, is_outside: np.ndarray, t: np.ndarray, facet: np.ndarray, a: np.ndarray, b: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The facets, as tetrahedra and their facets (e,), that are reached through the inside around edges (a, b) (e,)."""
    t, facet = t.copy(), facet.copy()
    turning = np.arange(len(t))
    for _ in range(len(mesh.corners)):
        corners = mesh.corners[t[turning]]
        ends = (corners == a[turning, None]) | (corners == b[turning, None])
        ends[np.arange(len(turning)), facet[turning]] = True
        facet[turning] = np.argmin(ends, axis=1)  # opposite the third corner of the facet before
        beyond = mesh.neighbours[t[turning], facet[turning]]
        goes_on = ~is_outside[beyond]
        turning, came, beyond = turning[goes_on], t[turning[goes_on]], beyond[goes_on]
        if len(turning) == 0:
            break
        t[turning] = beyond
        facet[turning] = np.argmax(mesh.neighbours[beyond] == came[:, None], axis=1)
    return t, facet


def split_at_vertices(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Give each fan of faces around a vertex a vertex of its own; faces are joined by edges of two faces.

    Args:
        faces: (m, 3) int, consistently oriented.

    Returns:
        (m, 3) int: faces as new ids, and (n,) int: the former id of each.
    """
    face = np.repeat(np.arange(len(faces)), 3)
    corner, ahead = 3 * face + np.tile([0, 1, 2], len(faces)), 3 * face + np.tile([1, 2, 0], len(faces))
    a, b = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    size = int(faces.max(initial=0)) + 1
    _, edge, count = np.unique(np.minimum(a, b) * size + np.maximum(a, b), return_inverse=True, return_counts=True)
    order = np.argsort(edge, kind="stable")
    order = order[count[edge[order]] == 2]
    one, two = order[::2], order[1::2]
    return _numbered(faces, np.concatenate([corner[one], ahead[one]]), np.concatenate([ahead[two], corner[two]]))


def _numbered(points: np.ndarray, ones: np.ndarray, others: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Number corners of faces (m, 3), the same for corners that are joined, in the order of their points."""
    n = points.size
    graph = coo_array((np.ones(len(ones), dtype=bool), (ones, others)), shape=(n, n))
    fan = connected_components(graph, directed=False)[1]
    _, first = np.unique(fan, return_index=True)
    order = np.argsort(points.ravel()[first], kind="stable")
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    return rank[fan].reshape(-1, 3), points.ravel()[first][order]
