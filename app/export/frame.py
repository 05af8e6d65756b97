"""Camera of exported pictures: looks approximately along the photos' mean direction, with the mesh filling the frame."""

import numpy as np

from app.stage import Stage
from fairing.camera import Camera
from fairing.scene import Scene

TURNED = 0.4  # from the cameras' mean direction (0) to the page's initial viewpoint (1), which avoids the frusta
MARGIN = 0.06  # relative to the shorter side of the frame


def framing_camera(
    scene: Scene, stage: Stage, states: list[np.ndarray], width: int, height: int | None = None
) -> Camera:
    """A camera whose picture contains all states of the mesh at the largest possible size.

    Args:
        states: vertices (n, 3) float, world units, of each state.
        width: of the picture, px.
        height: px; default: chosen by the shape of the mesh, between half the width and the width.
    """
    eye, target, up = stage.world_from_page(first_eye(stage)), stage.world_from_page(np.zeros(3)), stage.up
    forward = _unit(target - eye)
    right = _unit(np.cross(forward, up))
    R = np.stack([right, np.cross(forward, right), forward])
    used = np.unique(scene.mesh.faces)
    points = np.concatenate([state[used] for state in states])
    in_front = (points - eye) @ R.T
    in_front = in_front[in_front[:, 2] > 0]
    uv = in_front[:, :2] / in_front[:, 2:]  # at a focal length of 1
    low, high = uv.min(0), uv.max(0)
    extent = np.maximum(high - low, 1e-9)
    if height is None:
        needed = 2 * MARGIN + (1 - 2 * MARGIN) * extent[1] / extent[0]
        height = 2 * round(width / 2 * float(np.clip(needed, 0.5, 1)))
    size = np.array([width, height]) - 1
    focal = float(((size - 2 * MARGIN * min(width, height)) / extent).min())
    middle = size / 2 - focal * (low + high) / 2
    K = np.array([[focal, 0, middle[0]], [0, focal, middle[1]], [0, 0, 1]])
    return Camera.from_krt(K, R, -R @ eye, width, height)


def first_eye(stage: Stage) -> np.ndarray:
    """(3,) float, page units: initial viewpoint of exported pictures and pages; the view direction is to the origin."""
    towards = stage.camera_centers / np.linalg.norm(stage.camera_centers, axis=1, keepdims=True)
    first = _unit(stage.eye - stage.target)
    direction = _unit((1 - TURNED) * _unit(towards.mean(0)) + TURNED * first)
    if (
        np.linalg.norm(np.cross(direction, stage.up)) < 0.05
    ):  # looking along the up vector leaves the image rotation undefined
        direction = first
    return float(np.linalg.norm(stage.eye - stage.target)) * direction


def _unit(vector: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(vector)
    return vector / length if length > 1e-9 else vector
