"""Start meshes with realistic errors, sparse points, and the normals that photos can determine."""

import numpy as np

from fairing.geometry.normals import face_normals, unit_normals
from fairing.geometry.rasterize import rasterize
from fairing.mesh import Mesh
from fairing.scene import SparsePoints, Truth, View


def slide_off_corners(
    vertices: np.ndarray, faces: np.ndarray, distances: tuple[float, float], rng: np.random.Generator
) -> np.ndarray:
    """Start vertices (n, 3) like those from range data: on the true surface, but beside the true vertex.

    Each vertex moves to a random position on its incident true faces (or their coplanar neighbours) at a distance from it
    within `distances` (world units). Positions that flip or collapse a face are drawn again, up to 200 times; then the
    best of them is used.
    """
    normals, doubled = unit_normals(vertices, faces)
    start = vertices.copy()
    for v in rng.permutation(len(vertices)):
        ring = np.flatnonzero((faces == v).any(axis=1))
        best, best_score = vertices[v], -np.inf
        for _ in range(200):
            candidate = _on_surface_near(vertices, faces, normals, v, ring, rng.uniform(*distances), rng)
            if candidate is None:
                continue
            start[v] = candidate
            cross = face_normals(start, faces[ring])
            # Area left of each face, seen along its true normal, and how little it has turned.
            left = (cross * normals[ring]).sum(axis=1) / doubled[ring]
            turned = (cross * normals[ring]).sum(axis=1) / np.linalg.norm(cross, axis=1)
            score = min(left.min() / 0.4, turned.min() / 0.6)
            if score > best_score:
                best, best_score = candidate, score
            if score > 1:
                break
        start[v] = best
    return start


def faceted_truth(vertices: np.ndarray, faces: np.ndarray) -> Truth:
    """The truth of a surface of plane faces whose vertices (n, 3) are where those of the start mesh belong."""
    return Truth(Mesh(vertices, faces), vertices, determined_normals(vertices, faces))


def determined_normals(vertices: np.ndarray, faces: np.ndarray, least_angle: float = 0.17) -> list[np.ndarray]:
    """For each vertex the (d <= 3, 3) unit normals of true faces that meet there.

    A normal counts when it leaves the span of those before it by `least_angle` radians; the face that spans most comes
    first, so a vertex inside a plane has one, on an edge two, in a corner three.
    """
    normals, doubled = unit_normals(vertices, faces)
    found = []
    for v in range(len(vertices)):
        ring = np.flatnonzero((faces == v).any(axis=1))
        chosen = [normals[ring[np.argmax(doubled[ring])]]]
        while len(chosen) < 3:
            basis = np.linalg.qr(np.array(chosen).T)[0]
            rest = normals[ring] - normals[ring] @ basis @ basis.T
            farthest = np.argmax((rest**2).sum(axis=1))
            if np.linalg.norm(rest[farthest]) < np.sin(least_angle):
                break
            chosen.append(normals[ring[farthest]])
        found.append(np.array(chosen))
    return found


def displaced_at_random(
    vertices: np.ndarray, faces: np.ndarray, distances: tuple[float, float], rng: np.random.Generator
) -> np.ndarray:
    """Vertices (n, 3), each moved by a length within `distances`, at random but turning no face by 60 degrees."""
    normals, _ = unit_normals(vertices, faces)
    start = vertices.copy()
    for v in rng.permutation(len(vertices)):
        ring = np.flatnonzero((faces == v).any(axis=1))
        for _ in range(200):
            direction = rng.standard_normal(3)
            start[v] = vertices[v] + rng.uniform(*distances) * direction / np.linalg.norm(direction)
            if (unit_normals(start, faces[ring])[0] * normals[ring]).sum(axis=1).min() > 0.5:
                break
    return start


def observed_points(
    truth: Mesh, views: tuple[View, ...], count: int, error: float, rng: np.random.Generator, pixel_error: float = 0.3
) -> SparsePoints:
    """Sparse points of a reconstruction: spread over the part of the surface that three views or more see.

    Args:
        count: points drawn evenly over the surface; those that fewer views see are dropped.
        error: standard deviation of a point's coordinates, world units.
        pixel_error: standard deviation of the observed pixel coordinates.
    """
    _, areas = unit_normals(truth.vertices, truth.faces)
    face = rng.choice(len(areas), count, p=areas / areas.sum())
    a, b = np.sort(rng.random((count, 2)), axis=1).T
    weights = np.column_stack([a, b - a, 1 - b])
    places = np.einsum("pk,pkx->px", weights, truth.vertices[truth.faces[face]])
    pixels = np.zeros((count, len(views), 2))
    sees = np.zeros((count, len(views)), bool)
    colors = np.zeros((count, 3))
    for k, view in enumerate(views):
        camera = view.camera
        pixels[:, k], depth = camera.project(places)
        column, row = np.rint(pixels[:, k]).astype(int).T
        inside = (depth > 0) & (column >= 0) & (row >= 0) & (column < camera.width) & (row < camera.height)
        column, row = np.where(inside, column, 0), np.where(inside, row, 0)
        face_id, _ = rasterize(truth.vertices, truth.faces, camera)
        sees[:, k] = inside & (face_id[row, column] == face)
        colors += sees[:, k, None] * view.photo.load()[row, column]
    kept = np.flatnonzero(sees.sum(axis=1) >= 3)
    sees, pixels = sees[kept], pixels[kept]
    point_id, view_id = np.nonzero(sees)
    observed = pixels[point_id, view_id]
    return SparsePoints(
        positions=places[kept] + error * rng.standard_normal((len(kept), 3)),
        colors=np.rint(colors[kept] / sees.sum(axis=1)[:, None]).astype(np.uint8),
        observations=np.column_stack([point_id, view_id]),
        pixels=observed + pixel_error * rng.standard_normal(observed.shape),
    )


def _on_surface_near(
    vertices: np.ndarray,
    faces: np.ndarray,
    normals: np.ndarray,
    vertex: int,
    ring: np.ndarray,
    distance: float,
    rng: np.random.Generator,
) -> np.ndarray | None:
    """A point at `distance` from the vertex in a random incident face's plane; None where it misses the surface."""
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
