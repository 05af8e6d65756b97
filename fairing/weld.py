"""Welding: which vertices of a file are one point of the surface, and which faces have no area.

Files repeat a vertex for every face, material or patch that uses it, and programs round each copy on its own. Stitched strips,
seams and rounding leave faces without area. Every tolerance is a fraction of a length nearby or a multiple of the resolution of
the coordinates, so that neither the unit nor the origin of the world matters.
"""

from dataclasses import dataclass

import numpy as np

from fairing.errors import InputError
from fairing.mesh import Mesh

FLAT = 5e-6
"""Of a face's longest edge: a lower height is no area. An edge that spans 20,000 pixels has a height of 0.1 pixels there, and
copies that differ by 1e-6 of an edge span at most 3.5e-6."""
NEAR = 3e-5
"""Of the shortest among the longest edges of the faces around: copies of a vertex are at most that far apart."""
ULPS = 2.0
"""Of the spacing of float32 at the coordinates, if they are all float32: rounding moves two copies apart, or a corner off the line
through two others, by at most the square root of 3."""
MOST_FLAT, MOST_NEAR = 1e-3, 1e-3
"""Largest fractions that the resolution of the coordinates raises `FLAT` and `NEAR` to: detail as coarse as that is kept."""
_NEIGHBOURS = 16
"""Nearest vertices that are compared with each: the copies of a vertex are close together and far from all others."""

_MOST_CAREFULLY = 256
"""Copies of a vertex that are merged pair by pair, which takes time with their square."""


@dataclass(frozen=True, eq=False)
class Welded:
    """The surface of a mesh as read.

    Attributes:
        original: the mesh as read.
        mesh: the distinct vertices, each where its first copy is, and the faces with area in the order of the input.
        vertex_of_input: (n_input,) int: for each vertex of the input its index in `mesh`.
        input_faces: (m,) int: for each face of `mesh` its index in the input.
    """

    original: Mesh
    mesh: Mesh
    vertex_of_input: np.ndarray
    input_faces: np.ndarray

    @property
    def all_faces(self) -> Mesh:
        """The distinct vertices with all faces of the input, also those without area."""
        return Mesh(self.mesh.vertices, self.vertex_of_input[self.original.faces])

    @property
    def displacement(self) -> np.ndarray:
        """(n_input,) float, world units: distance of each vertex of the input from the copy that stands for it."""
        return np.linalg.norm(self.mesh.vertices[self.vertex_of_input] - self.original.vertices, axis=1)


def welded(original: Mesh) -> Welded:
    """Merge the copies of each vertex and leave out the faces without area.

    Raises:
        InputError: no face has area.
    """
    vertices, vertex_of_input = weld(original.vertices, original.faces)
    faces = vertex_of_input[original.faces]
    input_faces = np.flatnonzero(~without_area(vertices, faces))
    if len(input_faces) == 0:
        raise InputError(f"mesh: expected a surface, found that all {len(faces)} faces have no area; repair the mesh")
    return Welded(original, Mesh(vertices, faces[input_faces]), vertex_of_input, input_faces)


def without_area(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(m,) bool: faces whose height on their longest edge is below `FLAT` of it, or within the resolution of the coordinates.

    Such a face has no normal that could be relied on. See `weld` for the arguments.
    """
    corners = vertices[faces]
    sides = np.roll(corners, -1, axis=1) - corners
    longest = np.linalg.norm(sides, axis=2).max(axis=1)
    sides = sides / np.where(longest > 0, longest, 1)[:, None, None]
    height = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    resolution = _resolution(vertices)[faces].max(axis=1) / np.where(longest > 0, longest, np.inf)
    return height < np.clip(ULPS * resolution, FLAT, MOST_FLAT)


def weld(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Merge vertices at one place, keeping the order of first appearance.

    Vertices with equal coordinates are one. Others are one if they differ by rounding (`NEAR`, `ULPS`); two corners of a face with
    area never are, so that no edge of the surface collapses.

    Args:
        vertices: (n, 3) float, world units.
        faces: (m, 3) int.

    Returns:
        The distinct vertices (w, 3), each where its first copy is, and for each input vertex its index among them (n,) int.
    """
    distinct, index = merged_if_equal(vertices)
    corners = index[faces]
    has_area = ~without_area(distinct, corners)
    tolerance = _tolerance(distinct, corners, has_area)
    pairs = _close_pairs(distinct, tolerance)
    if len(pairs) == 0:
        return distinct, index
    label = _clusters(distinct, corners[has_area], tolerance, pairs)
    first, cluster = np.unique(label, return_inverse=True)
    return distinct[first], cluster[index]


def merged_if_equal(vertices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Merge vertices (n, 3) with equal coordinates alone; results as of `weld`."""
    order = np.lexsort(vertices.T)  # stable: equal vertices keep their order of appearance
    is_new = np.ones(len(order), dtype=bool)
    is_new[1:] = (vertices[order[1:]] != vertices[order[:-1]]).any(axis=1)
    first = np.empty(len(order), dtype=np.int64)
    first[order] = order[is_new][np.cumsum(is_new) - 1]
    kept, index = np.unique(first, return_inverse=True)
    return vertices[kept], index


def _resolution(vertices: np.ndarray) -> np.ndarray:
    """(n,) float, world units: spacing of float32 at each vertex's largest coordinate; 0 if some coordinates are no float32."""
    with np.errstate(over="ignore", under="ignore"):
        single = vertices.astype(np.float32)
    if not (single == vertices).all():
        return np.zeros(len(vertices))
    return np.spacing(np.abs(single).max(axis=1)).astype(np.float64)


def _tolerance(vertices: np.ndarray, faces: np.ndarray, has_area: np.ndarray) -> np.ndarray:
    """(n,) float, world units: how far the copies of each vertex may be apart; 0 for vertices of no face.

    Faces without area, which may have collapsed, count for vertices of no other face.
    """
    corners = vertices[faces]
    longest = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max(axis=1)
    around, beside = np.full(len(vertices), np.inf), np.zeros(len(vertices))
    np.minimum.at(around, faces[has_area], longest[has_area, None])
    np.maximum.at(beside, faces, longest[:, None])
    around = np.where(np.isinf(around), beside, around)
    return np.clip(ULPS * _resolution(vertices), NEAR * around, MOST_NEAR * around)


def _close_pairs(vertices: np.ndarray, tolerance: np.ndarray) -> np.ndarray:
    """(p, 2) int: pairs of vertices within the tolerance (n,) of both, the nearest pairs first."""
    none = np.zeros((0, 2), dtype=np.int64)
    if len(vertices) < 2 or not tolerance.any():
        return none
    from scipy.spatial import KDTree  # imported on first use: every command imports scenes, few weld

    tree, most = KDTree(vertices), float(tolerance.max())
    nearest = np.asarray(tree.query(vertices, 2, distance_upper_bound=2 * most)[0])[:, 1]
    some = np.flatnonzero(nearest <= tolerance)
    if len(some) == 0:
        return none
    count = min(_NEIGHBOURS + 1, len(vertices))
    distance, other = map(np.asarray, tree.query(vertices[some], count, distance_upper_bound=2 * most))
    one = np.repeat(some, count).reshape(distance.shape)
    found = np.isfinite(distance)
    one, other, distance = one[found], other[found], distance[found]
    close = (one != other) & (distance <= np.minimum(tolerance[one], tolerance[other]))
    one, other, distance = one[close], other[close], distance[close]
    # Each pair was found from one of its ends or from both. As one number: np.unique over rows is slower.
    keys, at = np.unique(np.minimum(one, other) * len(vertices) + np.maximum(one, other), return_index=True)
    order = np.argsort(distance[at], kind="stable")
    return np.column_stack(np.divmod(keys[order], len(vertices)))


def _clusters(vertices: np.ndarray, faces: np.ndarray, tolerance: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """(n,) int: for each vertex (n, 3) the first vertex of its cluster.

    Args:
        faces: (s, 3) int: the faces with area.
        tolerance, pairs: see `_close_pairs`.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    n = len(vertices)
    graph = coo_array((np.ones(len(pairs), dtype=bool), pairs.T), shape=(n, n))
    component = connected_components(graph, directed=False)[1]
    first = np.full(component.max() + 1, n)
    np.minimum.at(first, component, np.arange(n))
    label = first[component]
    # A component that is wider than its tolerance, or holds two corners of a face, is built up pair by pair instead.
    low, high, least = (np.full((n, 3), np.inf), np.full((n, 3), -np.inf), np.full(n, np.inf))
    np.minimum.at(low, label, vertices)
    np.maximum.at(high, label, vertices)
    np.minimum.at(least, label, tolerance)
    linked = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    linked = linked[label[linked[:, 0]] == label[linked[:, 1]]]
    refused = np.zeros(n, dtype=bool)
    refused[first] = np.linalg.norm(high[first] - low[first], axis=1) > least[first]
    refused[label[linked[:, 0]]] = True
    if refused.any():
        taken_apart = np.flatnonzero(refused[label])
        careful = pairs[refused[label[pairs[:, 0]]]]
        label[taken_apart] = taken_apart
        _merge_pair_by_pair(label, vertices, tolerance, careful, linked)
    return label


def _merge_pair_by_pair(
    label: np.ndarray, vertices: np.ndarray, tolerance: np.ndarray, pairs: np.ndarray, linked: np.ndarray
) -> None:
    """Merge pairs (p, 2) in their order, except where it would merge two linked vertices or exceed the tolerance.

    Args:
        label: (n,) int: cluster of each vertex; modified.
        linked: (l, 2) int: vertices that stay apart.
    """
    members: dict[int, list[int]] = {}
    foes: dict[int, set[int]] = {}
    for a, b in linked.tolist():
        foes.setdefault(a, set()).add(b)
        foes.setdefault(b, set()).add(a)
    for a, b in pairs.tolist():
        one, two = sorted((int(label[a]), int(label[b])))
        if one == two:
            continue
        mine, other = members.get(one, [one]), members.get(two, [two])
        both = mine + other
        if len(both) > _MOST_CAREFULLY:
            continue
        if any(not foes.get(v, set()).isdisjoint(other) for v in mine):
            continue
        if np.linalg.norm(np.ptp(vertices[both], axis=0)) > tolerance[both].min():
            continue
        members[one] = both
        members.pop(two, None)
        label[other] = one
