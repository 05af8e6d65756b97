"""Object's box layer: the edges of the box whose sparse points were triangulated, and a box that is being chosen."""

from collections.abc import Callable

import numpy as np
import viser

from app.debugger.run_state import RunState
from app.page_state.page_state import PageState
from app.palette import GHOST, SELECTED
from app.stage import SIZE, Stage
from app.viser_bridge.corner_control import CornerControl
from app.viser_bridge.line_node import LineNode
from fairing.scene import Scene
from fairing.triangulation.object_box import ObjectBox, box_of_corners

HANDLE = 0.12 * SIZE  # page units
ROUNDING = 1e-5 * SIZE  # page units: browsers compute in 32 bits
THINNEST = 1e-3 * SIZE  # page units: a box is not made thinner


class ObjectBoxLayer:
    """Twelve lines, if the points in a box were triangulated. Twelve more of a box that is being chosen, whose opposite corners
    can be dragged.

    Args:
        on_choose: called when a corner was dragged.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        stage: Stage,
        scene: Scene,
        page_state: PageState,
        on_choose: Callable[[], None],
    ) -> None:
        self._stage, self._page_state = stage, page_state
        self._edges = None if scene.object_box is None else self._lines(scene.object_box)
        self._node = LineNode(client, "/object_box", GHOST, 1.2)
        if not scene.triangulated:
            return
        self._chosen = LineNode(client, "/chosen_box/edges", SELECTED, 2.0)
        self._corners = [
            CornerControl(client, f"/chosen_box/{name}", HANDLE, lambda place, k=k: self._move(k, place), on_choose)
            for k, name in enumerate(("low", "high"))
        ]
        self._is_chosen_shown = False

    def show(self, state: RunState, page_state: PageState) -> None:
        is_free = page_state.entered is None
        self._node.show(self._edges if page_state.shows("object box") and is_free else None)
        box = page_state.box if is_free else None
        if box is None and not self._is_chosen_shown:
            return
        self._is_chosen_shown = box is not None
        self._chosen.show(None if box is None else self._lines(box_of_corners(box)))
        places = (None, None) if box is None else self._stage.page_from_world(np.reshape(box, (2, 3)))
        for control, place in zip(self._corners, places, strict=True):
            control.show(place)

    def _move(self, k: int, place: np.ndarray) -> None:
        """The corner k is at a place (3,), page units; it does not pass the other one."""
        box = self._page_state.box
        if box is None:
            return
        world = np.reshape(box, (2, 3)).astype(np.float64)
        corners = self._stage.page_from_world(world).astype(np.float64)
        place = np.minimum(place, corners[1] - THINNEST) if k == 0 else np.maximum(place, corners[0] + THINNEST)
        is_moved = np.abs(place - corners[k]) > ROUNDING  # the others keep their digits
        world[k, is_moved] = self._stage.world_from_page(place)[is_moved]
        (x0, y0, z0), (x1, y1, z1) = world.tolist()
        self._page_state.box = x0, y0, z0, x1, y1, z1
        self._chosen.show(self._lines(box_of_corners(self._page_state.box)))

    def _lines(self, box: ObjectBox) -> np.ndarray:
        """(12, 2, 3) float, page units."""
        return self._stage.page_from_world(box.edges())
