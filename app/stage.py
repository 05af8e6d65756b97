"""Where the scene stands in the page: near the origin, a few units large, upright, seen from a good side.

The browser computes in 32 bits, so a scene far from the origin, or very large or small, would shake and clip.
"""

from dataclasses import dataclass

import numpy as np

from fairing.scene import Scene

SIZE = 4.0  # diagonal of the mesh in page units
FIELD_OF_VIEW = np.radians(45.0)  # vertical
# The first look is turned away from the cameras' mean direction, so that their frusta do not stand in the way.
TURN_SIDEWAYS = np.radians(28.0)
TURN_UP = np.radians(20.0)
FILLS = 0.68  # of the window's height
CLEAR_GROUND = 3.0  # ratio of the x axes' spreads in and across the ground from which on they tell where up is
NEAR_AXIS = np.cos(np.radians(40.0))


@dataclass(frozen=True, eq=False)
class Stage:
    """The map from world to page, and the first look.

    Attributes:
        origin: (3,) float, world units: the middle of the mesh.
        scale: page units of a world unit.
        up: (3,) float, page: unit vector.
        eye, target: (3,) float, page: the first look.
        camera_scale: page units: size of a camera's frustum.
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
        towards = _unit((centers / np.linalg.norm(centers, axis=1, keepdims=True)).mean(0), fallback=-rotations[0, 2])
        distance = SIZE / 2 / FILLS / np.tan(FIELD_OF_VIEW / 2)
        eye = distance * _first_direction(towards, up)
        apart = np.linalg.norm(centers[:, None] - centers, axis=-1)
        spacing = float(np.median((apart + np.diag(np.full(len(apart), np.inf))).min(axis=1)))
        # The timeline covers the window's lower part.
        target = -0.07 * distance * up
        camera_scale = float(np.clip(0.2 * spacing, 0.01 * SIZE, 0.06 * SIZE))
        return cls(origin, scale, up, eye + target, target, camera_scale, centers)

    def frontal(self) -> np.ndarray:
        """(3,) float, page: an eye as far off as at first, in the midst of the directions the photos were taken from."""
        towards = (self.camera_centers / np.linalg.norm(self.camera_centers, axis=1, keepdims=True)).mean(0)
        return self.target + np.linalg.norm(self.eye - self.target) * _unit(towards, self.eye - self.target)

    def overview(self) -> np.ndarray:
        """(3,) float, page: an eye from which mesh and cameras are in sight, looking at the target as at first."""
        direction = (self.eye - self.target) / np.linalg.norm(self.eye - self.target)
        reach = np.concatenate([self.camera_centers, np.zeros((1, 3))]) - self.target
        along = reach @ direction
        across = np.linalg.norm(reach - along[:, None] * direction, axis=1)
        distance = float((along + 1.25 * across / np.tan(FIELD_OF_VIEW / 2)).max())
        return self.target + max(distance, float(np.linalg.norm(self.eye - self.target))) * direction

    def page_from_world(self, points: np.ndarray) -> np.ndarray:
        """Positions (..., 3) in page units, float32, of positions in world units."""
        return ((points - self.origin) * self.scale).astype(np.float32)

    def world_from_page(self, points: np.ndarray) -> np.ndarray:
        """Positions (..., 3) in world units of positions in page units."""
        return np.asarray(points, dtype=np.float64) / self.scale + self.origin


def _upright(rotations: np.ndarray) -> np.ndarray:
    """(3,) unit vector that the photographers held for up.

    Photos are taken with a level horizon: their x axes span the ground, and up is normal to it. Where all look the same
    way, the x axes do not span it; then a world axis near the photos' mean up serves, else that itself.
    """
    mean_up = _unit(-rotations[:, 1].mean(0), fallback=np.array([0.0, 0.0, 1.0]))
    values, vectors = np.linalg.eigh(rotations[:, 0].T @ rotations[:, 0] / len(rotations))
    normal = vectors[:, 0] * np.sign(vectors[:, 0] @ mean_up or 1.0)
    guess = normal if values[1] > CLEAR_GROUND * max(values[0], 1e-3) and normal @ mean_up > 0.5 else mean_up
    nearest = np.zeros(3)
    nearest[np.argmax(np.abs(guess))] = np.sign(guess[np.argmax(np.abs(guess))])
    return nearest if guess @ nearest > NEAR_AXIS else guess


def _first_direction(towards: np.ndarray, up: np.ndarray) -> np.ndarray:
    """The cameras' mean direction, turned sideways and up, but not over the top."""
    level = towards - (towards @ up) * up
    if np.linalg.norm(level) < 0.2:  # they look straight down or up
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
