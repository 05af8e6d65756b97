"""What a user does to vertices: choose them, one or many; lock, reset and drag them."""

from collections.abc import Callable
from typing import Any

import numpy as np
import viser

from app.debugger.commands import Lock, Pause, Place, Reset
from app.debugger.controller import Controller
from app.page_state.page_state import PageState
from app.page_state.selection import Selection
from app.picking import vertices_within
from app.stage import Stage
from app.viser_bridge.html_events import whole_number
from app.viser_bridge.picking_camera import camera_of
from fairing.errors import InputError
from fairing.mesh import Mesh

ClickableNode = viser.BatchedMeshHandle | viser.CameraFrustumHandle | viser.MeshHandle


class VertexInteraction:
    """Chooses vertices for one browser.

    Args:
        guarded: turns what a call throws into a note in the page.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        stage: Stage,
        mesh: Mesh,
        controller: Controller,
        view: PageState,
        guarded: Callable[[Callable[..., None]], Callable[..., None]],
    ) -> None:
        self._client, self._stage, self._mesh = client, stage, mesh
        self._controller, self._view = controller, view
        self._clicked_at: tuple[float, float] | None = None  # where in the window a node was clicked last
        rectangle = guarded(self._choose_rectangle)
        client.scene.on_rect_select(modifier="shift")(lambda event: rectangle(event.screen_min, event.screen_max))

        # Coroutines run in the order of the clicks; plain functions would run at the same time on several threads.
        async def click_beside(event: viser.SceneClickEvent) -> None:
            self._click_beside(event.screen_pos)

        listen: Any = client.scene.on_click()  # whose type does not name coroutines
        listen(click_beside)

    def choose(self, selection: Selection) -> None:
        """Select these and no others."""
        self._view.selection = selection
        self._controller.republish()

    def select(self, vertex: object) -> None:
        """Select one vertex and no others."""
        last = len(self._mesh.vertices) - 1
        self.choose(Selection((whole_number(vertex, 0, last, "vertex"),)))

    def click(self, vertex: int, adds: bool) -> None:
        """A click on a vertex in the scene."""
        self.choose(self._view.selection.toggled(vertex) if adds else Selection((vertex,)))

    def toggle_lock(self) -> None:
        """Lock the selected vertices, or unlock them if all are locked."""
        vertices = self._chosen()
        self._controller.post(Lock(vertices, locked=not self._controller.state.locked[list(vertices)].all()))

    def reset(self) -> None:
        """Put the selected vertices back to their start, those that are not locked."""
        chosen, locked = self._chosen(), self._controller.state.locked
        free = tuple(vertex for vertex in chosen if not locked[vertex])
        self._controller.post(Reset(free or chosen))

    def grab(self) -> np.ndarray:
        """The hand takes the selected vertices: a run stops. Returns where all vertices are, (n, 3), world units."""
        state = self._controller.state
        if state.is_moving:
            self._controller.post(Pause())
        return state.vertices

    def drop(self, vertices: np.ndarray, positions: np.ndarray) -> None:
        """The hand lets go of vertices (u,) at positions (u, 3), world units."""
        x_y_z = [(float(x), float(y), float(z)) for x, y, z in positions]
        self._controller.post(Place(tuple(vertices.tolist()), tuple(x_y_z)))

    def _chosen(self) -> tuple[int, ...]:
        if not self._view.selection.vertices:
            raise InputError("no vertex is selected; click one first")
        return self._view.selection.vertices

    def watch(self, node: ClickableNode) -> None:
        """A click on this node is no click beside the mesh. To be called for every node that can be clicked."""

        async def note(event: viser.SceneNodePointerEvent) -> None:
            self._clicked_at = event.screen_pos

        node.on_click(note)

    def _click_beside(self, screen_pos: tuple[float, float]) -> None:
        # One click on a node is reported twice, for the node and then for the scene.
        is_on_node, self._clicked_at = screen_pos == self._clicked_at, None
        if not is_on_node and self._view.selection.vertices:
            self.choose(Selection())

    def _choose_rectangle(self, low: tuple[float, float], high: tuple[float, float]) -> None:
        vertices = self._stage.page_from_world(self._controller.state.vertices).astype(np.float64)
        view = self._view
        covered = view.entered is None and view.surface != "none"
        found = vertices_within(vertices, self._mesh, camera_of(self._client), low, high, see_through=not covered)
        self.choose(view.selection.extended(found.tolist()))
