"""Certainty layer: covariance ellipsoids of the selected vertices, elongated along weakly constrained directions."""

import numpy as np
import viser

from app.debugger.run_state import RunState
from app.page_state.certainty_source import CertaintySource, drawn_half_axis
from app.page_state.page_state import PageState
from app.palette import SELECTED
from app.stage import Stage
from app.viser_bridge.line_node import LineNode
from fairing.judge.certainty import Certainty
from fairing.mesh import Mesh

LONGEST = 6.0  # upper limit of the other half-axes, in lengths of the shortest
PIECES = 48  # line segments per circle


def ellipsoid_lines(certainty: Certainty, center: np.ndarray, shortest: float) -> np.ndarray:
    """(3 PIECES + 1, 2, 3) float: three ellipses, each through two axes, and the longest axis, as line segments.

    Args:
        center: (3,) float.
        shortest: length of the shortest half-axis, in the unit of `center`.
    """
    half_axes = (shortest * np.minimum(certainty.lengths, LONGEST))[:, None] * certainty.axes
    angle = np.linspace(0, 2 * np.pi, PIECES + 1)
    cosine, sine = np.cos(angle)[:, None], np.sin(angle)[:, None]
    circles = [cosine * half_axes[a] + sine * half_axes[b] for a, b in ((0, 1), (1, 2), (2, 0))]
    pieces = [np.stack([circle[:-1], circle[1:]], axis=1) for circle in circles]
    return center + np.concatenate([*pieces, [[-half_axes[2], half_axes[2]]]])


class CertaintyLayer:
    """All ellipsoids in one node. Hidden while a run moves the mesh."""

    def __init__(self, client: viser.ClientHandle, stage: Stage, mesh: Mesh, source: CertaintySource) -> None:
        self._stage, self._mesh, self._source = stage, mesh, source
        self._lines = LineNode(client, "/certainty", SELECTED, 1.8)

    def show(self, state: RunState, page_state: PageState) -> None:
        found: list[Certainty] = []
        if page_state.shows("certainty") and not state.is_moving:
            found = [certainty for certainty in self._source.latest(state, page_state)[1] if certainty.is_seen]
        lines = [self._ellipsoid(certainty, state.vertices) for certainty in found]
        self._lines.show(np.concatenate(lines) if lines else None)

    def _ellipsoid(self, certainty: Certainty, vertices: np.ndarray) -> np.ndarray:
        """Line segments of an ellipsoid, page units."""
        shortest = drawn_half_axis(self._mesh, vertices, certainty.vertex)
        lines = ellipsoid_lines(certainty, vertices[certainty.vertex], shortest)
        return self._stage.page_from_world(lines)
