"""What the photos determine of the selected vertices: ellipsoids, long where the aperture problem leaves them free."""

import numpy as np
import viser

from app.debugger.run_state import RunState
from app.page_state.certainty_source import CertaintySource
from app.page_state.page_state import PageState
from app.palette import SELECTED
from app.stage import Stage
from app.viser_bridge.line_node import LineNode
from fairing.judge.certainty import Certainty
from fairing.mesh import Mesh

SHORTEST = 0.08  # half-axis, of the mean edge at the vertex: larger than any real deviation, so that it can be seen
LONGEST = 6.0  # half-axes, of the shortest
PIECES = 48  # lines of a circle


def ellipsoid_lines(certainty: Certainty, center: np.ndarray, shortest: float) -> np.ndarray:
    """(3 PIECES + 1, 2, 3) float: its three circles about two axes each, and its longest axis.

    Args:
        center: (3,) float.
        shortest: half-axis, in the unit of `center`.
    """
    half_axes = (shortest * np.minimum(certainty.lengths, LONGEST))[:, None] * certainty.axes
    angle = np.linspace(0, 2 * np.pi, PIECES + 1)
    cosine, sine = np.cos(angle)[:, None], np.sin(angle)[:, None]
    circles = [cosine * half_axes[a] + sine * half_axes[b] for a, b in ((0, 1), (1, 2), (2, 0))]
    pieces = [np.stack([circle[:-1], circle[1:]], axis=1) for circle in circles]
    return center + np.concatenate([*pieces, [[-half_axes[2], half_axes[2]]]])


class CertaintyLayer:
    """All ellipsoids in one node, away while the mesh moves by itself."""

    def __init__(self, client: viser.ClientHandle, stage: Stage, mesh: Mesh, source: CertaintySource) -> None:
        self._stage, self._mesh, self._source = stage, mesh, source
        self._lines = LineNode(client, "/certainty", SELECTED, 1.8)

    def show(self, state: RunState, page_state: PageState) -> None:
        found: list[Certainty] = []
        if page_state.shows("certainty") and not state.is_moving:
            found = [certainty for certainty in self._source.newest(state, page_state) if certainty.is_seen]
        lines = [self._ellipsoid(certainty, state.vertices) for certainty in found]
        self._lines.show(np.concatenate(lines) if lines else None)

    def _ellipsoid(self, certainty: Certainty, vertices: np.ndarray) -> np.ndarray:
        """Lines in page units."""
        center = vertices[certainty.vertex]
        neighbours = np.unique(self._mesh.faces[self._mesh.one_rings[certainty.vertex]])
        edges = np.linalg.norm(vertices[neighbours[neighbours != certainty.vertex]] - center, axis=1)
        lines = ellipsoid_lines(certainty, center, SHORTEST * float(edges.mean()))
        return self._stage.page_from_world(lines)
