"""Poses of a browser's camera, written so that they always arrive."""

from copy import copy
from dataclasses import dataclass

import numpy as np
import viser

ELSEWHERE = 1.0  # scene units: anywhere else will do


@dataclass(frozen=True, eq=False)
class CameraPose:
    """Attributes:
    position: (3,) float, scene units.
    target: (3,) float, scene units: the point that the user orbits about.
    up: (3,) float.
    fov: vertical field of view, radians.
    """

    position: np.ndarray
    target: np.ndarray
    up: np.ndarray
    fov: float


def get_camera_pose(client: viser.ClientHandle) -> CameraPose:
    """The pose as the browser last reported it."""
    camera = client.camera
    return CameraPose(
        np.array(camera.position), np.array(camera.look_at), np.array(camera.up_direction), float(camera.fov)
    )


def set_camera_pose(client: viser.ClientHandle, pose: CameraPose) -> None:
    """Move the camera there; the client's camera has the pose once the browser has reported it.

    viser 1.1.1 sends only what differs from the browser's last report, which may be older than what was sent last. So
    everything is set to another value first, on a copy that no report can change in between.
    """
    side = np.cross(pose.up, np.eye(3)[np.argmin(np.abs(pose.up))])
    elsewhere = CameraPose(pose.position + ELSEWHERE, pose.position + ELSEWHERE + side, side, pose.fov / 2)
    camera = copy(client.camera)
    camera._state = copy(camera._state)
    with client.atomic():
        for wanted in (elsewhere, pose):
            camera.position = wanted.position
            camera.look_at = wanted.target
            camera.up_direction = wanted.up
            camera.fov = wanted.fov
