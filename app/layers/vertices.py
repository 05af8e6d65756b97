"""Vertices layer: clickable marks for the vertices, spheres for free ones and blocks for locked ones."""

from collections.abc import Callable

import numpy as np
import viser

from app.debugger.history import REJECTIONS
from app.debugger.run_state import RunState
from app.layers.marks import ball, block, mark_radius
from app.page_state.page_state import PageState
from app.palette import LOCKED, NOW, REJECTED, SELECTED, START
from app.stage import Stage
from app.viser_bridge.instance_marks import InstanceMarks
from app.viser_bridge.node_events import BackgroundClicks
from fairing.mesh import Mesh

MANY = 1500  # vertices; beyond this, marks have 20 triangles instead of 80 (ledger: vertex mark triangles)


class VerticesLayer:
    """Green: unmoved. Red: moved. Pink: last step rejected. Grey blocks: locked. Yellow: selected.

    The current vertex of the selection is larger than the others.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        stage: Stage,
        mesh: Mesh,
        on_click: Callable[[int, bool], None],
        background: BackgroundClicks,
    ) -> None:
        self._stage, self._radius = stage, mark_radius(stage, mesh)
        sphere, positions = ball(0 if len(mesh.vertices) > MANY else 1), stage.page_from_world(mesh.vertices)
        self._free = InstanceMarks(client, "/vertices/free", sphere, positions, on_click)
        self._locked = InstanceMarks(client, "/vertices/locked", block(), positions, on_click)
        for marks in (self._free, self._locked):
            background.ignore_clicks_on(marks.node)

    def show(self, state: RunState, page_state: PageState) -> None:
        colors = vertex_colors(state, page_state.selection.vertices)
        scales = np.full(
            len(state.vertices), self._radius * (0.6 if page_state.entered is not None else 1), dtype=np.float32
        )
        scales[list(page_state.selection.vertices)] *= 1.4
        if page_state.selected is not None:
            scales[page_state.selected] *= 1.25
        is_visible = page_state.shows("vertices")
        positions = self._stage.page_from_world(state.vertices)
        for marks, chosen in ((self._free, ~state.locked), (self._locked, state.locked)):
            marks.show(chosen, positions, colors, scales, is_visible)


def vertex_colors(state: RunState, selected: tuple[int, ...]) -> np.ndarray:
    """(n, 3) uint8: colours of the marks, see `VerticesLayer`."""
    colors = np.tile(np.array(START, dtype=np.uint8), (len(state.vertices), 1))
    colors[(state.vertices != state.trace.start).any(axis=1)] = NOW
    record = state.record
    if record is not None:
        colors[record.vertices[np.isin(record.reasons, REJECTIONS)]] = REJECTED
    colors[state.locked] = LOCKED
    colors[list(selected)] = SELECTED
    return colors
