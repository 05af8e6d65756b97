"""Object's box layer: the edges of the box whose sparse points were triangulated."""

import viser

from app.debugger.run_state import RunState
from app.page_state.page_state import PageState
from app.palette import GHOST
from app.stage import Stage
from app.viser_bridge.line_node import LineNode
from fairing.scene import Scene


class ObjectBoxLayer:
    """Twelve lines; nothing where all points were triangulated, or the mesh was read."""

    def __init__(self, client: viser.ClientHandle, stage: Stage, scene: Scene) -> None:
        box = scene.object_box
        self._edges = None if box is None else stage.page_from_world(box.edges())
        self._node = LineNode(client, "/object_box", GHOST, 1.2)

    def show(self, state: RunState, page_state: PageState) -> None:
        self._node.show(self._edges if page_state.shows("object box") and page_state.entered is None else None)
