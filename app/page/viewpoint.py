"""Viewpoint: an eye position from which a vertex of the mesh can be seen."""

import numpy as np
import trimesh

from fairing.geometry.normals import face_normals
from fairing.mesh import Mesh

AWAY = 20.0  # distance of the eye from the vertex, in mean distances of the corners of its faces
LEAST_FACING = 0.2  # cosine between line of sight and normal below which the surface is seen too obliquely
FAN = 200  # directions over the sphere: about 14 degrees apart
CLEARANCE = np.radians(3.0)  # around a line of sight: a gap narrower than this shows too little of the surface
BEFORE_OBSTACLE = 0.8  # share of the way to the first obstacle at which the eye stays
ALONG_UP = 0.05  # sine of the angle between line of sight and up direction below which the camera's roll is undefined


def viewpoint(
    vertex: int, vertices: np.ndarray, mesh: Mesh, eye: np.ndarray, up: np.ndarray, cameras: np.ndarray
) -> np.ndarray:
    """The position (3,) of the eye for a close view of a vertex that no face hides.

    The present line of sight is kept if nothing hides the vertex along it and the surface is not seen too obliquely.
    Otherwise the best of these directions is chosen: along the normal, towards the cameras of the photos, and all around.
    The best one shows the surface from its outer side, and is free of faces as far as the eye goes.

    Args:
        vertices: (n, 3) float: present positions of the mesh's vertices, any unit.
        eye: (3,) float: the present position of the eye.
        up: (3,) float: unit vector, the camera's up direction.
        cameras: (V, 3) float: centres of the photos' cameras.
    """
    point, ring = vertices[vertex], mesh.one_rings[vertex]
    distance = float(np.linalg.norm(eye - point))
    normal = np.zeros(3)
    if len(ring):
        distance = min(distance, AWAY * float(np.linalg.norm(vertices[mesh.faces[ring]] - point, axis=-1).mean()))
        normal = face_normals(vertices, mesh.faces[ring]).sum(axis=0)
        normal /= max(float(np.linalg.norm(normal)), 1e-300)
    directions = np.concatenate([[eye - point, normal], cameras - point, _fan()])
    lengths = np.linalg.norm(directions, axis=1)
    directions = directions[lengths > 0] / lengths[lengths > 0, None]
    directions = directions[np.linalg.norm(np.cross(directions, up), axis=1) > ALONG_UP]
    free = np.minimum(_free_lengths(point, directions, vertices, np.delete(mesh.faces, ring, axis=0)), distance)
    facing = directions @ normal
    best = int(np.argmax(free * (1 + facing)))
    if free[0] == distance and facing[0] >= LEAST_FACING:
        best = 0
    return point + free[best] * directions[best]


def _fan() -> np.ndarray:
    """(FAN, 3) float: unit vectors spread evenly over the sphere on a spiral."""
    height = 1 - (2 * np.arange(FAN) + 1) / FAN
    angle = np.pi * (3 - 5**0.5) * np.arange(FAN)
    across = np.sqrt(1 - height**2)
    return np.stack([across * np.cos(angle), across * np.sin(angle), height], axis=1)


def _free_lengths(point: np.ndarray, directions: np.ndarray, vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(d,) float: how far the eye may be from a point (3,) in each direction (d, 3) without faces in between; inf: any.

    Args:
        faces: (m, 3) int: of the mesh without those at the point.
    """
    side = np.cross(directions, np.eye(3)[np.argmin(np.abs(directions), axis=1)])
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    across = np.cross(directions, side)
    spread = np.tan(CLEARANCE) * np.stack([0 * side, side, -side, across, -across])
    rays = (directions + spread).reshape(-1, 3)
    if len(faces) == 0:
        return np.full(len(directions), np.inf)
    shape = trimesh.Trimesh(vertices, faces, process=False)
    hits, ray, _ = shape.ray.intersects_location(np.broadcast_to(point, rays.shape), rays, multiple_hits=False)
    lengths = np.full(len(rays), np.inf)
    lengths[ray] = BEFORE_OBSTACLE * np.linalg.norm(hits - point, axis=1)
    return lengths.reshape(len(spread), -1).min(axis=0)
