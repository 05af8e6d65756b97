"""Layers of boxes: the edges of the box whose sparse points were triangulated, and a box that is being chosen."""

from collections.abc import Callable

import numpy as np
import viser

from app.debugger.run_state import RunState
from app.page_state.page_state import PageState
from app.palette import GHOST, SELECTED
from app.stage import SIZE, Stage
from app.viser_bridge.corner_control import CornerControl
from app.viser_bridge.line_node import LineNode
from fairing.scene import BoxCorners, Scene
from fairing.triangulation.object_box import box_of_corners

HANDLE = 0.12 * SIZE  # page units
ROUNDING = 1e-5 * SIZE  # page units: browsers compute in 32 bits
THINNEST = 1e-3 * SIZE  # page units: a box is not made thinner


class ObjectBoxLayer:
    """Twelve lines; nothing where all points were triangulated, or the mesh was read."""

    def __init__(self, client: viser.ClientHandle, stage: Stage, scene: Scene) -> None:
        box = scene.object_box
        self._edges = None if box is None else stage.page_from_world(box.edges())
        self._node = LineNode(client, "/object_box", GHOST, 1.2)

    def show(self, state: RunState, page_state: PageState) -> None:
        self._node.show(self._edges if page_state.shows("object box") and page_state.entered is None else None)


class ChosenBoxLayer:
    """Twelve lines of the box that is being chosen, whose opposite corners can be dragged.

    Args:
        on_choose: called when a corner was dragged.
    """

    def __init__(
        self, client: viser.ClientHandle, stage: Stage, page_state: PageState, on_choose: Callable[[], None]
    ) -> None:
        self._stage, self._page_state = stage, page_state
        self._node = LineNode(client, "/chosen_box/edges", SELECTED, 2.0)
        self._corners = [
            CornerControl(client, f"/chosen_box/{name}", HANDLE, lambda place, k=k: self._move(k, place), on_choose)
            for k, name in enumerate(("low", "high"))
        ]

    def show(self, state: RunState, page_state: PageState) -> None:
        box = page_state.box if page_state.entered is None else None
        self._draw(box)
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
        self._draw(self._page_state.box)

    def _draw(self, box: BoxCorners | None) -> None:
        self._node.show(None if box is None else self._stage.page_from_world(box_of_corners(box).edges()))
