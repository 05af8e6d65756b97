"""Delaunay triangulation of a plane polygon with holes: ear clipping, point insertion, edge flips.

The border is never split, so that patches with a common border fit together.
"""

from itertools import pairwise

import numpy as np

Point = tuple[float, float]


def triangulate(loops: list[np.ndarray], interior: np.ndarray) -> np.ndarray:
    """Triangles (m, 3) int, counter-clockwise, into the loops' points in their order, then the interior points.

    Args:
        loops: the outer border (k, 2) counter-clockwise, then holes (k, 2) clockwise; no point twice.
        interior: (p, 2) further vertices, strictly inside.
    """
    points: list[Point] = [(float(x), float(y)) for loop in [*loops, interior] for x, y in loop]
    starts = np.cumsum([0, *map(len, loops)])
    rings = [list(range(a, b)) for a, b in pairwise(starts)]
    border = {(ring[i - 1], ring[i]) for ring in rings for i in range(len(ring))}
    triangles = _cut_ears(points, _one_ring(points, rings))
    _flip_to_delaunay(points, triangles, border, 0)
    for added in range(starts[-1], len(points)):
        _flip_to_delaunay(points, triangles, border, _insert(points, triangles, added))
    return np.array(triangles)


def lattice_inside(loops: list[np.ndarray], spacing: float, margin: float) -> np.ndarray:
    """Points (p, 2) of a triangular lattice inside the polygon, at least `margin` away from its border."""
    low, high = loops[0].min(axis=0), loops[0].max(axis=0)
    rows = max(1, round((high[1] - low[1]) / (spacing * 0.866)))
    found = []
    for r in range(1, rows):
        y = low[1] + r * (high[1] - low[1]) / rows
        columns = max(1, round((high[0] - low[0]) / spacing))
        x = low[0] + (np.arange(columns) + 0.5 * (r % 2)) * (high[0] - low[0]) / columns
        found += [(float(v), float(y)) for v in x]
    candidates = np.array(found).reshape(-1, 2)
    a = np.concatenate(loops)
    b = np.concatenate([np.roll(loop, -1, axis=0) for loop in loops])
    return candidates[_is_inside(candidates, a, b) & (_distance(candidates, a, b) > margin)]


def _is_inside(points: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Even-odd rule for points (p, 2) against the segments a to b (s, 2) of all loops."""
    x, y = points[:, :1], points[:, 1:]
    spans = (a[:, 1] > y) != (b[:, 1] > y)
    rise = np.where(a[:, 1] == b[:, 1], 1.0, b[:, 1] - a[:, 1])
    crossing = a[:, 0] + (y - a[:, 1]) * (b[:, 0] - a[:, 0]) / rise
    return (spans & (x < crossing)).sum(axis=1) % 2 == 1


def _distance(points: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Distance (p,) of points to the nearest of the segments."""
    along = b - a
    t = np.einsum("psx,sx->ps", points[:, None] - a, along) / (along**2).sum(axis=1)
    foot = a + np.clip(t, 0, 1)[..., None] * along
    return np.sqrt(((points[:, None] - foot) ** 2).sum(axis=-1)).min(axis=1)


def _turn(a: Point, b: Point, c: Point) -> float:
    """Twice the signed area: positive where the path a, b, c turns left."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _one_ring(points: list[Point], rings: list[list[int]]) -> list[int]:
    """Outer border and holes as one closed walk: every hole is joined by the shortest bridge that crosses nothing."""
    walk = list(rings[0])
    waiting = rings[1:]
    while waiting:
        edges = [(ring[i - 1], ring[i]) for ring in [walk, *waiting] for i in range(len(ring))]
        bridges = sorted(
            ((points[p][0] - points[q][0]) ** 2 + (points[p][1] - points[q][1]) ** 2, i, j, h)
            for i, p in enumerate(walk)
            for h, hole in enumerate(waiting)
            for j, q in enumerate(hole)
        )
        for _, i, j, h in bridges:
            hole = waiting[h]
            before, at, after = (points[walk[k % len(walk)]] for k in (i - 1, i, i + 1))
            if not _opens_to(before, at, after, points[hole[j]]):
                continue
            if not any(_cross(points, walk[i], hole[j], a, b) for a, b in edges):
                walk = walk[: i + 1] + hole[j:] + hole[: j + 1] + walk[i:]
                waiting.pop(h)
                break
    return walk


def _opens_to(before: Point, at: Point, after: Point, target: Point) -> bool:
    """Whether the corner of a counter-clockwise walk has the target inside it (a walk may pass a point twice)."""
    left = _turn(before, at, target) > 0, _turn(at, after, target) > 0
    return all(left) if _turn(before, at, after) > 0 else any(left)


def _cross(points: list[Point], p: int, q: int, a: int, b: int) -> bool:
    """Whether segment p-q touches segment a-b other than in a common end."""
    if {p, q} & {a, b}:
        return False
    P, Q, A, B = points[p], points[q], points[a], points[b]
    return _turn(P, Q, A) * _turn(P, Q, B) <= 0 and _turn(A, B, P) * _turn(A, B, Q) <= 0


def _cut_ears(points: list[Point], walk: list[int]) -> list[list[int]]:
    triangles = []
    walk = list(walk)
    while len(walk) > 3:
        for i in range(len(walk)):
            a, b, c = walk[i - 1], walk[i], walk[(i + 1) % len(walk)]
            if _turn(points[a], points[b], points[c]) <= 1e-12:
                continue
            if not any(p not in (a, b, c) and _contains(points, (a, b, c), points[p]) for p in walk):
                triangles.append([a, b, c])
                walk.pop(i)
                break
        else:
            raise AssertionError("polygon crosses itself")
    return [*triangles, walk]


def _contains(points: list[Point], triangle, p: Point) -> bool:
    a, b, c = (points[k] for k in triangle)
    return _turn(a, b, p) >= -1e-12 and _turn(b, c, p) >= -1e-12 and _turn(c, a, p) >= -1e-12


def _insert(points: list[Point], triangles: list[list[int]], added: int) -> int:
    """Split the triangle, or the two at the edge, where the point lies. Returns the index of the first new triangle."""
    p = points[added]
    split = [t for t in triangles if _contains(points, t, p)]
    for triangle in split:
        triangles.remove(triangle)
    first = len(triangles)
    for a, b, c in split:
        for u, v in ((a, b), (b, c), (c, a)):
            if _turn(points[u], points[v], p) > 1e-9:
                triangles.append([u, v, added])
    return first


def _flip_to_delaunay(
    points: list[Point], triangles: list[list[int]], border: set[tuple[int, int]], first: int
) -> None:
    """Lawson's flips, in place, until no edge inside has a point in its circle; ties stay as they are.

    Args:
        first: index of the first triangle that is new; edges between the others need no flip.
    """
    facing = {(t[k], t[(k + 1) % 3]): i for i, t in enumerate(triangles) for k in range(3)}
    pending = [(a, b) for (a, b), i in facing.items() if i >= first or facing.get((b, a), -1) >= first]
    while pending:
        a, b = pending.pop()
        if (a, b) in border or (b, a) in border or (a, b) not in facing or (b, a) not in facing:
            continue
        i, j = facing[a, b], facing[b, a]
        c = next(k for k in triangles[i] if k not in (a, b))
        d = next(k for k in triangles[j] if k not in (a, b))
        if _in_circle(points[a], points[b], points[c], points[d]) <= 1e-9:
            continue
        triangles[i], triangles[j] = [c, a, d], [d, b, c]
        del facing[a, b], facing[b, a]
        facing.update({(c, a): i, (a, d): i, (d, c): i, (d, b): j, (b, c): j, (c, d): j})
        pending += [(c, a), (a, d), (d, b), (b, c)]


def _in_circle(a: Point, b: Point, c: Point, d: Point) -> float:
    """Positive where d lies inside the circle through a, b, c (counter-clockwise)."""
    rows = [(p[0] - d[0], p[1] - d[1]) for p in (a, b, c)]
    (ax, ay), (bx, by), (cx, cy) = rows
    a2, b2, c2 = (x * x + y * y for x, y in rows)
    return ax * (by * c2 - b2 * cy) - ay * (bx * c2 - b2 * cx) + a2 * (bx * cy - by * cx)
