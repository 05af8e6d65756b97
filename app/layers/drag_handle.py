"""Drag handle: a ball that drags the selected vertices, with a preview of the edges around them."""

from collections.abc import Callable

import numpy as np
import viser

from app.debugger.run_state import RunState
from app.layers.marks import mark_radius, translucent_ball
from app.page_state.page_state import PageState
from app.palette import HAND, SELECTED
from app.picking import nearest_to_ray
from app.stage import Stage
from app.viser_bridge.line_node import LineNode
from app.viser_bridge.node_events import BackgroundClicks, on_node_click, on_node_drag
from app.viser_bridge.screen_limit import limit_on_screen
from fairing.mesh import Mesh

LARGER = 2.1  # radius of the ball, in radii of a vertex mark
LARGEST = 15.0  # screen px: its radius from nearby
MAX_PREVIEW = 3000  # edges drawn while dragging


class DragHandleLayer:
    """A ball at the current vertex unless it is locked. Dragging it moves all selected vertices parallel to the screen.

    Args:
        on_click: called on a click on the ball with the vertex and whether Shift was held.
        on_grab: called when a drag starts; returns the positions of all vertices (n, 3), world units.
        on_drop: called when a drag ends with the selected vertices (u,) and their positions (u, 3), world units.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        stage: Stage,
        mesh: Mesh,
        on_click: Callable[[int, bool], None],
        background: BackgroundClicks,
        on_grab: Callable[[], np.ndarray],
        on_drop: Callable[[np.ndarray, np.ndarray], None],
    ) -> None:
        self._stage, self._mesh = stage, mesh
        self._on_grab, self._on_drop = on_grab, on_drop
        self._radius = LARGER * mark_radius(stage, mesh)
        self._selected = np.zeros(0, dtype=int)  # the current vertex comes last
        self._points = stage.page_from_world(mesh.vertices)
        self._grabbed: np.ndarray | None = None
        self._ball = translucent_ball(client, "/drag_handle/ball", SELECTED, 0.45)
        limit_on_screen(client, "/drag_handle/ball", LARGEST)
        self._edges = LineNode(client, "/drag_handle/edges", SELECTED, 2.0)
        self._displacement = LineNode(client, "/drag_handle/displacement", HAND, 2.0)

        def clicked(event: viser.SceneNodePointerEvent, with_shift: bool) -> None:
            # The ball may have been drawn at an older position when the user clicked, so the vertex follows from the ray.
            vertex = nearest_to_ray(self._points, np.array(event.ray_origin), np.array(event.ray_direction))
            on_click(vertex, with_shift)

        on_node_click(self._ball, clicked)
        on_node_drag(self._ball, self._drag)
        background.ignore_clicks_on(self._ball)

    def show(self, state: RunState, page_state: PageState) -> None:
        if self._grabbed is not None:
            return
        self._points = self._stage.page_from_world(state.vertices)
        current = page_state.selected
        is_visible = current is not None and not state.locked[current] and page_state.shows("vertices")
        if current is not None:
            chosen = np.array(page_state.selection.vertices)
            self._selected = chosen[~state.locked[chosen]]
            self._ball.position = self._points[current]
            self._ball.scale = self._radius * (0.6 if page_state.entered is not None else 1)
        self._ball.visible = is_visible

    def _drag(self, phase: str, offset: np.ndarray) -> None:
        """Handle a phase of a drag. `offset` (3,), page units: movement of the pointer since the drag started."""
        if phase == "start":
            self._grabbed = self._on_grab() if len(self._selected) else None
        if self._grabbed is None:
            return
        after = self._grabbed.copy()
        after[self._selected] += offset / self._stage.scale
        if phase == "end":
            self._edges.hide()
            self._displacement.hide()
            self._grabbed = None
            self._on_drop(self._selected, after[self._selected])
            return
        around = self._mesh.edges[np.isin(self._mesh.edges, self._selected).any(axis=1)][:MAX_PREVIEW]
        page = self._stage.page_from_world
        self._ball.position = page(after[self._selected[-1]])
        self._edges.show(page(after[around]))
        self._displacement.show(page(np.stack([self._grabbed[self._selected], after[self._selected]], axis=1)))
