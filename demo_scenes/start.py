"""Start meshes that are wrong in the way real ones are, and what the truth allows to judge."""

import numpy as np

from demo_scenes.surface import face_normals


def slide_off_corners(
    vertices: np.ndarray, faces: np.ndarray, distances: tuple[float, float], rng: np.random.Generator
) -> np.ndarray:
    """Start vertices (n, 3) as range data gives them: on the true surface, but beside the true vertex.

    Each vertex goes to a random place on its incident true faces (or their coplanar neighbours) whose distance from it lies
    in `distances` (world units). No face flips or collapses: a place that would do this is drawn again; where none fits,
    the least bad of the draws is taken.
    """
    normals = face_normals(vertices, faces)
    areas = _doubled_areas(vertices, faces)
    start = vertices.copy()
    for v in rng.permutation(len(vertices)):
        ring = np.flatnonzero((faces == v).any(axis=1))
        best, best_score = vertices[v], -np.inf
        for _ in range(200):
            candidate = _on_surface_near(vertices, faces, normals, v, ring, rng.uniform(*distances), rng)
            if candidate is None:
                continue
            start[v] = candidate
            cross = _crosses(start, faces[ring])
            # Area left of each face, seen along its true normal, and how little it has turned.
            left = (cross * normals[ring]).sum(axis=1) / areas[ring]
            turned = (cross * normals[ring]).sum(axis=1) / np.linalg.norm(cross, axis=1)
            score = min(left.min() / 0.4, turned.min() / 0.6)
            if score > best_score:
                best, best_score = candidate, score
            if score > 1:
                break
        start[v] = best
    return start


def determined_normals(vertices: np.ndarray, faces: np.ndarray, least_angle: float = 0.17) -> list[np.ndarray]:
    """For each vertex the (d <= 3, 3) unit normals of true faces that meet there.

    A normal counts when it leaves the span of those before it by `least_angle` radians; the face that spans most comes
    first, so a vertex inside a plane has one, on an edge two, in a corner three.
    """
    normals = face_normals(vertices, faces)
    areas = _doubled_areas(vertices, faces)
    found = []
    for v in range(len(vertices)):
        ring = np.flatnonzero((faces == v).any(axis=1))
        chosen = [normals[ring[np.argmax(areas[ring])]]]
        while len(chosen) < 3:
            basis = np.linalg.qr(np.array(chosen).T)[0]
            rest = normals[ring] - normals[ring] @ basis @ basis.T
            farthest = np.argmax((rest**2).sum(axis=1))
            if np.linalg.norm(rest[farthest]) < np.sin(least_angle):
                break
            chosen.append(normals[ring[farthest]])
        found.append(np.array(chosen))
    return found


def _on_surface_near(
    vertices: np.ndarray,
    faces: np.ndarray,
    normals: np.ndarray,
    vertex: int,
    ring: np.ndarray,
    distance: float,
    rng: np.random.Generator,
) -> np.ndarray | None:
    """A point at `distance` from the vertex in the plane of a random incident face; None where it misses the surface."""
    face = rng.choice(ring)
    a, b = (vertices[k] - vertices[vertex] for k in faces[face] if k != vertex)
    t = rng.random()
    direction = (1 - t) * a / np.linalg.norm(a) + t * b / np.linalg.norm(b)
    point = vertices[vertex] + distance * direction / np.linalg.norm(direction)
    offset = ((point - vertices[faces[:, 0]]) * normals).sum(axis=1)
    coplanar = np.flatnonzero((np.abs(offset) < 1e-9) & (normals @ normals[face] > 1 - 1e-12))
    corners = vertices[faces[coplanar]]
    sides = np.roll(corners, -1, axis=1) - corners
    inward = np.cross(normals[coplanar][:, None], sides)
    return point if ((inward * (point - corners)).sum(axis=2) >= -1e-9).all(axis=1).any() else None


def _crosses(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def _doubled_areas(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    return np.linalg.norm(_crosses(vertices, faces), axis=1)
