"""Stage: the transform from world to page units, the up direction and the initial camera.

The browser computes in 32 bits: a scene far from the origin, or very large or small, would jitter and be clipped.
"""

from dataclasses import dataclass

import numpy as np

from fairing.geometry.normals import face_normals
from fairing.geometry.up_direction import up_direction
from fairing.scene import Scene

SIZE = 4.0  # diagonal of the mesh in page units
FIELD_OF_VIEW = np.radians(45.0)  # vertical
# The view of mesh and cameras is turned away from the cameras' mean direction, so that frusta do not hide the mesh.
TURN_SIDEWAYS = np.radians(28.0)
TURN_UP = np.radians(20.0)
MIN_MEAN = 0.3  # length of the mean of the cameras' directions; below it, they surround the mesh
ALONG_UP = 0.05  # sine of the angle
GOOD_ENOUGH = 0.8  # of the best direction's score: then the mean direction is taken
FILL = 0.85  # of the free view that the mesh occupies in width or height
# The view that panels leave free, in heights of the window (ledger: free view). The timeline covers its lower part.
FREE_WIDTH, FREE_HEIGHT = 0.78, 0.75
OUTLIERS = 0.005  # of the vertices at each side of a mesh, which do not count
NEAR_AXIS = np.cos(np.radians(40.0))


@dataclass(frozen=True, eq=False)
class Stage:
    """The transform from world to page units, and the initial camera.

    Attributes:
        origin: (3,) float, world units: the middle of the mesh.
        scale: page units of a world unit.
        up: (3,) float, page: unit vector.
        eye, target: (3,) float, page: position and target of the initial camera.
        camera_scale: size of a camera frustum, page units.
        camera_centers: (V, 3) float, page.
    """

    origin: np.ndarray
    scale: float
    up: np.ndarray
    eye: np.ndarray
    target: np.ndarray
    camera_scale: float
    camera_centers: np.ndarray

    @classmethod
    def of(cls, scene: Scene) -> "Stage":
        used = scene.mesh.vertices[np.unique(scene.mesh.faces)]
        origin = (used.min(0) + used.max(0)) / 2
        scale = SIZE / (scene.mesh.diagonal or 1.0)
        rotations = np.array([view.camera.camera_from_world[:, :3] for view in scene.views])
        centers = (np.array([view.camera.center for view in scene.views]) - origin) * scale
        up = _upright(rotations)
        direction = _first_direction(scene, centers / np.linalg.norm(centers, axis=1, keepdims=True), up)
        distance, target = _framed((used - origin) * scale, direction, up)
        apart = np.linalg.norm(centers[:, None] - centers, axis=-1)
        spacing = float(np.median((apart + np.diag(np.full(len(apart), np.inf))).min(axis=1)))
        camera_scale = float(np.clip(0.2 * spacing, 0.01 * SIZE, 0.06 * SIZE))
        return cls(origin, scale, up, distance * direction + target, target, camera_scale, centers)

    def frontal(self) -> np.ndarray:
        """(3,) float, page: an eye position in the cameras' mean direction, at the initial distance."""
        towards = (self.camera_centers / np.linalg.norm(self.camera_centers, axis=1, keepdims=True)).mean(0)
        return self.target + np.linalg.norm(self.eye - self.target) * _unit(towards, self.eye - self.target)

    def above(self) -> np.ndarray:
        """(3,) float, page: an eye position over the mesh; the cameras' side is below in the picture."""
        distance = float(np.linalg.norm(self.eye - self.target))
        level = self.frontal() - self.target
        level = level - (level @ self.up) * self.up
        return self.target_from_above() + distance * _unit(self.up + 0.02 * _unit(level, np.roll(self.up, 1)), self.up)

    def target_from_above(self) -> np.ndarray:
        """(3,) float, page: the point to look at from `above`, nearer to the cameras than the mesh's middle, since the
        timeline covers the lower part of the window."""
        level = self.frontal() - self.target
        level = level - (level @ self.up) * self.up
        return abs(float(self.target @ self.up)) * _unit(level, np.roll(self.up, 1))

    def overview(self) -> np.ndarray:
        """(3,) float, page: an eye position from which mesh and cameras are visible, beside the initial direction."""
        direction = _turned((self.eye - self.target) / np.linalg.norm(self.eye - self.target), self.up)
        reach = np.concatenate([self.camera_centers, np.zeros((1, 3))]) - self.target
        along = reach @ direction
        across = np.linalg.norm(reach - along[:, None] * direction, axis=1)
        distance = float((along + 1.25 * across / np.tan(FIELD_OF_VIEW / 2)).max())
        return self.target + max(distance, float(np.linalg.norm(self.eye - self.target))) * direction

    def page_from_world(self, points: np.ndarray) -> np.ndarray:
        """Page units (..., 3) float32 from world units (..., 3) float."""
        return ((points - self.origin) * self.scale).astype(np.float32)

    def world_from_page(self, points: np.ndarray) -> np.ndarray:
        """World units (..., 3) float from page units (..., 3)."""
        return np.asarray(points, dtype=np.float64) / self.scale + self.origin


def _framed(points: np.ndarray, direction: np.ndarray, up: np.ndarray) -> tuple[float, np.ndarray]:
    """The distance of the eye from its target along a direction (3,), and the target (3,): points (n, 3) then fill `FILL` of the
    free view, in its middle."""
    right = _unit(np.cross(up, direction), np.roll(up, 1))
    upward = np.cross(direction, right)
    window = 2 * np.tan(FIELD_OF_VIEW / 2)
    x, y, near = points @ right, points @ upward, points @ direction
    middle = np.array([0.0, window * (1 - FREE_HEIGHT) / 2])  # of the free view
    shift, distance = np.zeros(2), float(near.max()) + SIZE / window
    for _ in range(30):
        depth = np.maximum(distance - near, 1e-3 * SIZE)
        uv = np.stack([x - shift[0], y - shift[1]]) / depth
        low, high = np.quantile(uv, (OUTLIERS, 1 - OUTLIERS), axis=1)
        shift += ((low + high) / 2 - middle) * distance
        filled = float(((high - low) / (FILL * window * np.array([FREE_WIDTH, FREE_HEIGHT]))).max())
        distance *= max(filled, 0.1) ** 0.5
    return distance, shift[0] * right + shift[1] * upward


def _upright(rotations: np.ndarray) -> np.ndarray:
    """(3,) float: the up direction of cameras with rotations (V, 3, 3); a world axis near it replaces it."""
    guess = up_direction(rotations)
    nearest = np.zeros(3)
    nearest[np.argmax(np.abs(guess))] = np.sign(guess[np.argmax(np.abs(guess))])
    return nearest if guess @ nearest > NEAR_AXIS else guess


def _first_direction(scene: Scene, towards: np.ndarray, up: np.ndarray) -> np.ndarray:
    """(3,) float: the unit direction from the middle of the mesh to the initial camera.

    It is the mean of the directions to the cameras. If the cameras surround the mesh, or another camera's direction shows
    clearly more of the surface, it is that camera's. Where the truth is known, surface that is away from it counts more.

    Args:
        towards: (V, 3) float: unit directions from the middle of the mesh to the cameras.
        up: (3,) float: unit vector; the direction is never along it, since the camera's roll would be undefined.
    """
    vertices, faces = scene.mesh.vertices, scene.mesh.faces
    normals = face_normals(vertices, faces)  # as long as twice the area
    facing = normals @ towards.T
    outward = np.sign(np.median(facing.sum(axis=1))) or 1.0
    weight = np.ones(len(faces))
    if scene.truth is not None and scene.truth.vertices is not None:
        fault = np.linalg.norm(vertices - scene.truth.vertices, axis=1)
        weight += fault[faces].mean(axis=1) / (float(fault[faces].mean()) or 1.0)

    def score(direction: np.ndarray) -> float:
        return float(weight @ np.maximum(outward * (normals @ direction), 0))

    mean = towards.mean(axis=0)
    direction = max(towards, key=score)
    if np.linalg.norm(mean) >= MIN_MEAN:
        mean /= np.linalg.norm(mean)
        direction = mean if score(mean) >= GOOD_ENOUGH * score(direction) else direction
    if np.linalg.norm(np.cross(direction, up)) < ALONG_UP:
        direction = _unit(direction + 2 * ALONG_UP * np.roll(up, 1), direction)
    return direction


def _turned(towards: np.ndarray, up: np.ndarray) -> np.ndarray:
    """A direction turned sideways and up, but not beyond the zenith."""
    level = towards - (towards @ up) * up
    if np.linalg.norm(level) < 0.2:  # straight down or up
        return towards
    height = np.arcsin(np.clip(towards @ up, -1, 1))
    height = np.clip(height + TURN_UP, -1.2, max(1.2, height))
    level = _unit(level, level)
    side = np.cross(up, level)
    level = np.cos(TURN_SIDEWAYS) * level + np.sin(TURN_SIDEWAYS) * side
    return np.cos(height) * level + np.sin(height) * up


def _unit(vector: np.ndarray, fallback: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(vector)
    return vector / length if length > 1e-6 else fallback / np.linalg.norm(fallback)
