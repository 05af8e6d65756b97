"""Vertices layer: clickable marks for the vertices, and a ring around the vertex being stepped."""

from collections.abc import Callable

import numpy as np
import viser

from app.debugger.run_state import RunState
from app.layers.marks import ball, block, mark_radius, octahedron
from app.page_state.page_state import PageState
from app.page_state.vertex_marks import shown_vertices, stepped_vertex, vertex_colors
from app.palette import STEPPED
from app.stage import Stage
from app.viser_bridge.instance_marks import InstanceMarks
from app.viser_bridge.node_events import BackgroundClicks
from app.viser_bridge.screen_ring import ScreenRing
from fairing.mesh import Mesh

RING = 15.0  # screen px: radius of the ring, so that it surrounds the marks also where they are largest on the screen
RING_THICKNESS = 3.0  # screen px


class VerticesLayer:
    """A mark for every vertex, in the colours of `MARK_COLORS`; locked ones are blocks, others balls.

    The current vertex of the selection is larger than the others. Selected vertices are marked even if the layer is hidden.
    If vertices are stepped one by one, a ring surrounds the vertex of the last step, also where the surface hides it.
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
        balls, positions = (ball(1), ball(0), octahedron()), stage.page_from_world(mesh.vertices)
        self._free = InstanceMarks(client, "/vertices/free", balls, positions, on_click)
        self._locked = InstanceMarks(client, "/vertices/locked", (block(),), positions, on_click)
        for marks in (self._free, self._locked):
            background.ignore_clicks_on(marks.node)
        self._ring = ScreenRing(client, "/vertices/stepped", STEPPED, RING, RING_THICKNESS)

    def show(self, state: RunState, page_state: PageState) -> None:
        colors = vertex_colors(state, page_state.selection.vertices)
        scales = np.full(
            len(state.vertices), self._radius * (0.6 if page_state.entered is not None else 1), dtype=np.float32
        )
        scales[list(page_state.selection.vertices)] *= 1.4
        if page_state.selected is not None:
            scales[page_state.selected] *= 1.25
        shown = shown_vertices(state, page_state)
        positions = self._stage.page_from_world(state.vertices)
        for marks, chosen in ((self._free, ~state.locked), (self._locked, state.locked)):
            marks.show(chosen & shown, positions, colors, scales, True)
        stepped = stepped_vertex(state)
        self._ring.show(None if stepped is None else positions[stepped])
