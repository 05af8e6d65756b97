"""Decimation by quadric error metrics (Garland and Heckbert, SIGGRAPH 1997): edges collapse, cheapest first.

A collapsed edge's vertex goes where the squared distances to the planes of all faces merged so far are least, so vertices stay
at creases and corners. An oriented two-manifold stays one: an edge collapses only if the ends' links meet in its own link.
"""

import heapq

import numpy as np
from numba import njit

from fairing.geometry.normals import unit_normals
from fairing.util.compiled_only import COMPILED_ONLY

BORDER_WEIGHT = 10.0
"""Of the planes through border edges, relative to those of faces."""
LEAST_COSINE = 0.3
"""Between a face's normals before and after a collapse."""
LEAST_SHAPE = 0.1
"""Least height of a face over its longest edge after a collapse, unless it was flatter before."""
HOLD = 1e-6
"""Pull of the place to the edge's middle, where the planes leave it free; relative to the quadric's trace."""


def decimate(
    vertices: np.ndarray, faces: np.ndarray, spacing: np.ndarray, usual: int, most: int | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Collapse the cheapest edges, then those shorter than a spacing.

    Args:
        vertices: (n, 3) float, world units.
        faces: (m, 3) int, an oriented two-manifold with or without border, of which every vertex is a corner.
        spacing: (n,) float, world units: edges shorter than the mean of their ends' spacings collapse if no face folds over or
            becomes thin.
        usual: the cheapest edges collapse down to this number of vertices under the same condition.
        most: limit of the number of vertices; None: no limit. It may be missed where no manifold has so few.

    Returns:
        Vertices (p, 3) and faces (q, 3).
    """
    places, faces = vertices.astype(np.float64), faces.astype(np.int64)
    spacing = spacing.astype(np.float64)
    quadrics, alive = _quadrics(places, faces), np.ones(len(faces), dtype=bool)
    following = np.full(3 * len(faces), -1)
    first = np.full(len(places), -1)
    _link(faces, first, following)
    count = len(places)
    # Last, shapes are sacrificed to the limit.
    for only_short, careful, target in (
        (False, True, usual),
        (True, True, 0),
        (False, True, most),
        (False, False, most),
    ):
        if target is not None and count > target:
            count = _collapse_edges(
                places, faces, alive, quadrics, spacing, first, following, count, target, only_short, careful
            )
    used, corners = np.unique(faces[alive], return_inverse=True)
    return places[used], corners.reshape(-1, 3)


def _quadrics(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(n, 4, 4) float: squared distances to the planes of a vertex's faces and borders, weighted by area."""
    quadrics = np.zeros((len(vertices), 4, 4))
    normals, area = unit_normals(vertices, faces)
    planes = np.column_stack([normals, -(normals * vertices[faces[:, 0]]).sum(axis=1)])
    for k in range(3):
        np.add.at(quadrics, faces[:, k], area[:, None, None] * planes[:, :, None] * planes[:, None, :])
    half_edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    key, opposite = half_edges @ [len(vertices), 1], half_edges @ [1, len(vertices)]
    border = np.flatnonzero(~np.isin(key, opposite))
    a, b = half_edges[border].T
    along = vertices[b] - vertices[a]
    across = np.cross(along, normals[border // 3])
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-300)
    planes = np.column_stack([across, -(across * vertices[a]).sum(axis=1)])
    added = BORDER_WEIGHT * (along**2).sum(axis=1)[:, None, None] * planes[:, :, None] * planes[:, None, :]
    np.add.at(quadrics, a, added)
    np.add.at(quadrics, b, added)
    return quadrics


@njit(cache=True, nogil=True)
def _link(faces, first, following):
    """Lists of the corners at each vertex: `first` (n,), continued in `following` (3 m,); -1 at the end."""
    for corner in range(3 * len(faces) - 1, -1, -1):
        v = faces[corner // 3, corner % 3]
        following[corner], first[v] = first[v], corner


@njit(nogil=True, **COMPILED_ONLY)
def _cost(places, quadrics, a, b):
    """Quadric error of a collapsed edge, and where its vertex goes."""
    Q = quadrics[a] + quadrics[b]
    hold = HOLD * (Q[0, 0] + Q[1, 1] + Q[2, 2]) + 1e-300
    mx, my, mz = (places[a] + places[b]) / 2
    xx, yy, zz, xy, xz, yz = Q[0, 0] + hold, Q[1, 1] + hold, Q[2, 2] + hold, Q[0, 1], Q[0, 2], Q[1, 2]
    rx, ry, rz = hold * mx - Q[0, 3], hold * my - Q[1, 3], hold * mz - Q[2, 3]
    # By cofactors; the matrix is symmetric and positive definite.
    cxx, cxy, cxz = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    det = xx * cxx + xy * cxy + xz * cxz
    x, y, z = mx, my, mz
    squared = ((places[a] - places[b]) ** 2).sum()
    if det > 0:
        cyy, cyz, czz = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
        x = (cxx * rx + cxy * ry + cxz * rz) / det
        y = (cxy * rx + cyy * ry + cyz * rz) / det
        z = (cxz * rx + cyz * ry + czz * rz) / det
        if (
            not (x - mx) ** 2 + (y - my) ** 2 + (z - mz) ** 2 <= squared
        ):  # farther than the edge is long: badly determined
            x, y, z = mx, my, mz
    error = Q[0, 0] * x * x + Q[1, 1] * y * y + Q[2, 2] * z * z + Q[3, 3]
    error += 2 * (Q[0, 1] * x * y + Q[0, 2] * x * z + Q[1, 2] * y * z + Q[0, 3] * x + Q[1, 3] * y + Q[2, 3] * z)
    # Among equals the shortest edge first.
    return max(error, 0.0) + 1e-6 * squared * hold / HOLD, x, y, z


@njit(nogil=True, **COMPILED_ONLY)
def _is_short(places, spacing, a, b):
    """Whether an edge is shorter than the spacing at its ends."""
    return ((places[a] - places[b]) ** 2).sum() < (0.5 * (spacing[a] + spacing[b])) ** 2


@njit(nogil=True, **COMPILED_ONLY)
def _mark(faces, first, following, v, mark, stamp):
    """Mark the neighbours of a vertex; returns their number and that of its faces."""
    neighbours, n_faces, corner = 0, 0, first[v]
    while corner >= 0:
        n_faces += 1
        for k in range(3):
            w = faces[corner // 3, k]
            if w != v and mark[w] != stamp:
                mark[w] = stamp
                neighbours += 1
        corner = following[corner]
    return neighbours, n_faces


@njit(nogil=True, **COMPILED_ONLY)
def _shape(p, q, r):
    """Normal of a triangle, and its height over its longest edge."""
    u, v, w = q - p, r - p, r - q
    nx, ny, nz = u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]
    longest = max((u * u).sum(), (v * v).sum(), (w * w).sum())
    size = np.sqrt(nx * nx + ny * ny + nz * nz)
    return nx, ny, nz, size, size / max(longest, 1e-300)


@njit(nogil=True, **COMPILED_ONLY)
def _keeps_shape(places, faces, first, following, a, b, place):
    """Whether no face of a vertex a without b folds over or becomes thin when a moves."""
    corner = first[a]
    while corner >= 0:
        f, k = corner // 3, corner % 3
        q, r = faces[f, (k + 1) % 3], faces[f, (k + 2) % 3]
        if q != b and r != b:
            ax, ay, az, before, shape = _shape(places[a], places[q], places[r])
            bx, by, bz, after, new_shape = _shape(place, places[q], places[r])
            if ax * bx + ay * by + az * bz < LEAST_COSINE * before * after:
                return False
            if new_shape < min(LEAST_SHAPE, 0.7 * shape):
                return False
        corner = following[corner]
    return True


@njit(nogil=True, **COMPILED_ONLY)
def _stays_manifold(faces, first, following, a, b, mark, stamp):
    """Whether the surface stays a two-manifold when the edge of a and b collapses."""
    of_b, faces_of_b = _mark(faces, first, following, b, mark, stamp)
    of_a, faces_of_a = _mark(faces, first, following, a, mark, stamp + 1)
    # Neighbours of both have been marked twice.
    common, shared, corner = 0, 0, first[b]
    while corner >= 0:
        f, k = corner // 3, corner % 3
        for i in (1, 2):
            w = faces[f, (k + i) % 3]
            if w == a:
                shared += 1
            elif mark[w] == stamp + 1:
                mark[w] = stamp
                common += 1
        corner = following[corner]
    if common != shared:
        return False
    a_at_border, b_at_border = of_a != faces_of_a, of_b != faces_of_b
    if shared == 2 and a_at_border and b_at_border:
        return False
    ring = of_a + of_b - 2 - common
    return ring >= (2 if a_at_border or b_at_border else 3) and faces_of_a + faces_of_b > 2 * shared


@njit(cache=True, nogil=True)
def _collapse_edges(places, faces, alive, quadrics, spacing, first, following, count, target, only_short, careful):
    """Collapse edges, cheapest first, down to `target` vertices; returns the number of vertices that remain."""
    n = len(places)
    mark, age = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)
    stamp = 1
    heap = [(0.0, -1, -1, 0, 0)]
    heap.pop()
    for f in range(len(faces)):
        if alive[f]:
            for k in range(3):
                a, b = min(faces[f, k], faces[f, (k + 1) % 3]), max(faces[f, k], faces[f, (k + 1) % 3])
                if not only_short or _is_short(places, spacing, a, b):
                    heap.append((_cost(places, quadrics, a, b)[0], a, b, 0, 0))
    heapq.heapify(heap)
    place = np.zeros(3)
    while count > target and len(heap) > 0:
        _, a, b, age_a, age_b = heapq.heappop(heap)
        if age[a] != age_a or age[b] != age_b:
            continue
        stamp += 2
        if not _stays_manifold(faces, first, following, a, b, mark, stamp):
            continue
        _, place[0], place[1], place[2] = _cost(places, quadrics, a, b)
        if careful and not (
            _keeps_shape(places, faces, first, following, a, b, place)
            and _keeps_shape(places, faces, first, following, b, a, place)
        ):
            continue
        _merge(places, faces, alive, quadrics, spacing, first, following, a, b, place)
        count -= 1
        age[a] += 1
        age[b] = -1
        stamp += 2
        corner = first[a]
        while corner >= 0:
            for k in range(3):
                c = faces[corner // 3, k]
                if c != a and mark[c] != stamp:
                    mark[c] = stamp
                    low, high = min(a, c), max(a, c)
                    if not only_short or _is_short(places, spacing, low, high):
                        heapq.heappush(heap, (_cost(places, quadrics, low, high)[0], low, high, age[low], age[high]))
            corner = following[corner]
    return count


@njit(nogil=True, **COMPILED_ONLY)
def _merge(places, faces, alive, quadrics, spacing, first, following, a, b, place):
    """Merge vertex b into a, which moves to `place`; the faces of their edge end."""
    corner = first[b]
    while corner >= 0:
        f = corner // 3
        if faces[f, 0] == a or faces[f, 1] == a or faces[f, 2] == a:
            alive[f] = False
        corner = following[corner]
    for v in (a, b):
        corner = first[v]
        while corner >= 0:
            if not alive[corner // 3]:
                for k in range(3):
                    _unlink(faces, first, following, faces[corner // 3, k], corner // 3)
                corner = first[v]
            else:
                corner = following[corner]
    corner = first[b]
    while corner >= 0:
        beyond = following[corner]
        faces[corner // 3, corner % 3] = a
        following[corner], first[a] = first[a], corner
        corner = beyond
    first[b] = -1
    places[a] = place
    quadrics[a] += quadrics[b]
    spacing[a] = 0.5 * (spacing[a] + spacing[b])


@njit(nogil=True, **COMPILED_ONLY)
def _unlink(faces, first, following, v, face):
    """Remove a face from the list of a vertex."""
    before, corner = -1, first[v]
    while corner >= 0:
        if corner // 3 == face:
            if before < 0:
                first[v] = following[corner]
            else:
                following[before] = following[corner]
            return
        before, corner = corner, following[corner]
