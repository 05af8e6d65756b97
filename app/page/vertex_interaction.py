"""Vertex interaction: vertices are selected, one or many, locked, reset and dragged; sparse points are selected."""

import numpy as np
import viser

from app.debugger.commands import Lock, Pause, Place, Reset
from app.debugger.controller import Controller
from app.page_state.page_state import PageState
from app.page_state.selection import Selection
from app.picking import nearest_to_ray, point_under_pointer, vertices_within
from app.stage import Stage
from app.viser_bridge.error_toasts import NothingToDo
from app.viser_bridge.html_events import Guarded, whole_number
from app.viser_bridge.node_events import BackgroundClicks
from app.viser_bridge.picking_camera import camera_of
from fairing.scene import Scene

POINTER = 0.012  # of the field of view and of the view's height: 9 px in a view of 720


class VertexInteraction:
    """The selection of one browser, and what is done with it.

    Attributes:
        background: a click that hits no node selects a vertex without a mark or a sparse point, or deselects everything; every
            clickable node is registered there.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        stage: Stage,
        scene: Scene,
        controller: Controller,
        page_state: PageState,
        guarded: Guarded,
    ) -> None:
        self._client, self._stage, self._mesh = client, stage, scene.mesh
        self._sparse_points = scene.sparse_points
        self._controller, self._page_state = controller, page_state
        self.background = BackgroundClicks(client, guarded(self._click_background))
        select_rectangle = guarded(self._select_rectangle)
        client.scene.on_rect_select(modifier="shift")(
            lambda event: select_rectangle(event.screen_min, event.screen_max)
        )

    def set_selection(self, selection: Selection) -> None:
        """Select these vertices and no others; of the current one the face with the largest energy is shown."""
        self._page_state.selection, self._page_state.point = selection, None
        self._page_state.face, self._page_state.picks_face = None, True
        self._controller.republish()

    def select(self, vertex: object) -> None:
        """Select one vertex and no others.

        Raises:
            InputError: there is no such vertex.
        """
        last = len(self._mesh.vertices) - 1
        self.set_selection(Selection((whole_number(vertex, 0, last, "vertex"),)))

    def click_vertex(self, vertex: int, adds: bool) -> None:
        """Select a vertex that was clicked; `adds` keeps the others, and deselects it if it was selected."""
        self.set_selection(self._page_state.selection.toggled(vertex) if adds else Selection((vertex,)))

    def toggle_lock(self) -> None:
        """Lock the selected vertices, or unlock them if all are locked."""
        vertices = self._selected()
        self._controller.post(Lock(vertices, locked=not self._controller.state.locked[list(vertices)].all()))

    def reset(self) -> None:
        """Move the selected vertices that are not locked to their start positions."""
        selected, locked = self._selected(), self._controller.state.locked
        free = tuple(vertex for vertex in selected if not locked[vertex])
        self._controller.post(Reset(free or selected))

    def begin_drag(self) -> np.ndarray:
        """Pause a run before its vertices are dragged. Returns the positions of all vertices, (n, 3), world units."""
        state = self._controller.state
        if state.is_moving:
            self._controller.post(Pause())
        return state.vertices

    def end_drag(self, vertices: np.ndarray, positions: np.ndarray) -> None:
        """Place vertices (u,) int at positions (u, 3), world units."""
        x_y_z = [(float(x), float(y), float(z)) for x, y, z in positions]
        self._controller.post(Place(tuple(vertices.tolist()), tuple(x_y_z)))

    def _selected(self) -> tuple[int, ...]:
        if not self._page_state.selection.vertices:
            raise NothingToDo("no vertex is selected; click one first")
        return self._page_state.selection.vertices

    def _click_background(self, event: viser.SceneClickEvent) -> None:
        page_state, points, found = self._page_state, self._sparse_points, None
        if points is not None and page_state.shows("points"):
            places = self._stage.page_from_world(points.positions)
            angle = POINTER * float(self._client.camera.fov)
            found = point_under_pointer(places, np.array(event.ray_origin), np.array(event.ray_direction), angle)
        vertex = None if found is not None or page_state.shows("vertices") else self._vertex_at(event)
        if vertex is not None:
            self.set_selection(Selection((vertex,)))
        elif found is not None or page_state.selection.vertices or page_state.point is not None:
            page_state.selection, page_state.point = Selection(), found
            self._controller.republish()

    def _vertex_at(self, event: viser.SceneClickEvent) -> int | None:
        """The visible vertex nearest to the pointer; None if there is none near it."""
        camera, (x, y) = camera_of(self._client), event.screen_pos
        reach = POINTER * camera.height / camera.width
        found = self._visible_within((x - reach, y - POINTER), (x + reach, y + POINTER))
        if len(found) == 0:
            return None
        places = self._stage.page_from_world(self._controller.state.vertices[found])
        return int(found[nearest_to_ray(places, np.array(event.ray_origin), np.array(event.ray_direction))])

    def _select_rectangle(self, low: tuple[float, float], high: tuple[float, float]) -> None:
        self.set_selection(self._page_state.selection.extended(self._visible_within(low, high).tolist()))

    def _visible_within(self, low: tuple[float, float], high: tuple[float, float]) -> np.ndarray:
        """(u,) int: the vertices in a rectangle of the view, without those that the surface hides."""
        vertices = self._stage.page_from_world(self._controller.state.vertices).astype(np.float64)
        covered = self._page_state.entered is None and self._page_state.surface != "none"
        return vertices_within(vertices, self._mesh, camera_of(self._client), low, high, see_through=not covered)
