"""Step arrow layer: the last step of the selected vertex in the photo looked through (the paper's figure 4a)."""

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

NEARER = 0.9  # depth of the arrow in depths of the vertex, so that the surface does not hide it
HEAD = 0.25  # length of the head, in lengths of the arrow


def pixel_arrow(camera: Camera, before: np.ndarray, after: np.ndarray, scale: float) -> np.ndarray | None:
    """(3, 2, 3) float, world units: shaft and head of an arrow that projects to the step's displacement in the photo.

    Args:
        before, after: (3,) float, world units.
        scale: length of the arrow, in lengths of the displacement.

    Returns:
        None if a point lies behind the camera or the displacement is zero.
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
    """One arrow, shown while a camera is looked through."""

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
