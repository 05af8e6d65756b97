"""The frame of a capture from photos alone: z up, the object in the middle, a unit of its own size."""

from collections.abc import Sequence

import numpy as np

from fairing.geometry.up_direction import up_direction
from fairing.placement.frames import MeshFrame
from fairing.scene import SparsePoints, View
from fairing.triangulation.object_box import find_object


def upright_frame(views: Sequence[View], points: SparsePoints) -> MeshFrame:
    """The frame for a capture in an arbitrary one. Photos alone determine neither its place nor its unit.

    Up is the normal of the ground under the object, else what the photos' horizons give (`up_direction`). Where the cameras go
    around an object, its box is in the middle and along the axes; else the median point is, and the cameras look along y. The
    unit is the median distance from a camera to a point that it sees.
    """
    box = find_object(views, points)
    rotations = np.array([view.camera.camera_from_world[:, :3] for view in views])
    if box is not None and box.orbited:
        axes, middle = box.axes, box.middle
    else:
        up, middle = up_direction(rotations), np.median(points.positions, axis=0)
        ahead = rotations[:, 2].mean(axis=0)
        ahead = ahead - (ahead @ up) * up
        if np.linalg.norm(ahead) < 0.1:  # all around, or straight down
            ahead = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
        ahead /= np.linalg.norm(ahead)
        axes = np.stack([np.cross(ahead, up), ahead, up])
    centers = np.array([view.camera.center for view in views])
    seen = points.positions[points.observations[:, 0]] - centers[points.observations[:, 1]]
    unit = float(np.median(np.linalg.norm(seen, axis=1)))
    return MeshFrame("upright", unit * axes.T, middle)
