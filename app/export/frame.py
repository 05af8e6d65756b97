"""Camera of exported pictures: looks in the direction in which the page opens, with the mesh filling the frame."""

import numpy as np

from app.stage import Stage
from fairing.camera import Camera
from fairing.scene import Scene

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
    """(3,) float, page units: viewpoint of exported pictures and pages, in the direction in which the page opens.

    The view direction is to the origin.
    """
    return stage.eye - stage.target


def _unit(vector: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(vector)
    return vector / length if length > 1e-9 else vector
