"""A layer: the normal of every face, as a line from its middle."""

import numpy as np
import viser

from app.debugger.run_state import RunState
from app.page_state.page_state import PageState
from app.stage import Stage
from fairing.geometry.normals import unit_normals
from fairing.scene import Scene

LENGTH = 0.15  # page units; the diagonal of a mesh has 4


class Normals:
    """Made once for each browser; `show` is called with every state."""

    def __init__(self, client: viser.ClientHandle, stage: Stage, scene: Scene) -> None:
        self._stage, self._faces = stage, scene.mesh.faces
        points = self._segments(scene.mesh.vertices)
        color, px = (255, 160, 0), 2.0
        self._lines = client.scene.add_line_segments("/normals", points, color, thickness=px, thickness_units="screen")

    def show(self, state: RunState, page_state: PageState) -> None:
        self._lines.points = self._segments(state.vertices)

    def _segments(self, vertices: np.ndarray) -> np.ndarray:
        corners = self._stage.page_from_world(vertices)
        begin = corners[self._faces].mean(axis=1)
        normals, _ = unit_normals(corners, self._faces)
        return np.stack([begin, begin + LENGTH * normals], axis=1).astype(np.float32)
