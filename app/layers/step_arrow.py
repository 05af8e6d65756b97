"""Seen through a camera: how far the selected vertex' last step moved it in the photo (the paper's figure 4a)."""

import numpy as np
import viser

from app.debugger.history import last_step_about
from app.debugger.run_state import RunState
from app.page_state.page_state import PageState
from app.palette import SELECTED
from app.stage import Stage
from app.viser_bridge.line_node import LineNode
from fairing.camera import Camera
from fairing.scene import Scene

NEARER = 0.9  # of the vertex' depth: in front of what the camera sees there
HEAD = 0.25  # of the arrow's length


def pixel_arrow(camera: Camera, before: np.ndarray, after: np.ndarray, scale: float) -> np.ndarray | None:
    """(3, 2, 3) float, world units: shaft and head of an arrow that the camera sees as the step's pixel displacement.

    Args:
        before, after: (3,) float, world units.
        scale: the arrow is so many times longer than the displacement.

    Returns:
        None where a point lies behind the camera or the step moves no pixel.
    """
    (tail, tip), depths = camera.project(np.stack([before, after]))
    along = scale * (tip - tail)
    if (depths <= 0).any() or not np.linalg.norm(along) > 0:
        return None
    across = np.array([-along[1], along[0]])
    end = tail + along
    wings = [end - HEAD * along + side * 0.5 * HEAD * across for side in (1, -1)]
    pixels = np.array([[tail, end], [end, wings[0]], [end, wings[1]]])
    homogeneous = np.concatenate([pixels, np.ones((3, 2, 1))], axis=-1)
    # P [X; 1] = depth [u; 1], solved for X at one depth.
    P, depth = camera.image_from_world, NEARER * float(depths[0])
    return np.linalg.solve(P[:, :3], (depth * homogeneous - P[:, 3])[..., None])[..., 0]


class StepArrowLayer:
    """One arrow, only while a camera is looked through."""

    def __init__(self, client: viser.ClientHandle, stage: Stage, scene: Scene) -> None:
        self._stage, self._scene = stage, scene
        self._lines = LineNode(client, "/step_arrow", SELECTED, 3.0)

    def show(self, state: RunState, page_state: PageState) -> None:
        arrow = self._arrow(state, page_state)
        self._lines.show(None if arrow is None else self._stage.page_from_world(arrow))

    def _arrow(self, state: RunState, page_state: PageState) -> np.ndarray | None:
        if page_state.entered is None or page_state.selected is None:
            return None
        found = last_step_about(state.trace.steps, state.moment, page_state.selected)
        if found is None:
            return None
        _, record, slot = found
        camera = self._scene.views[page_state.entered].camera
        return pixel_arrow(camera, record.before[slot], record.after[slot], page_state.cells.arrow_scale)
