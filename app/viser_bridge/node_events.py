"""Clicks and drags on nodes of the scene."""

from collections.abc import Callable
from typing import Any

import numpy as np
import viser

ClickableNode = viser.BatchedMeshHandle | viser.CameraFrustumHandle | viser.MeshHandle


def on_node_click(node: ClickableNode, call: Callable[[viser.SceneNodePointerEvent, bool], None]) -> None:
    """Call with the event and whether Shift was held.

    viser 1.1.1 matches modifiers exactly: a callback without one is not called for a click with Shift.
    """
    node.on_click(lambda event: call(event, False))
    node.on_click(modifier="shift")(lambda event: call(event, True))


def on_node_drag(node: viser.MeshHandle, call: Callable[[str, np.ndarray], None]) -> None:
    """Call with the phase ("start", "update" or "end") and the offset from the start, (3,) scene units.

    A coroutine, because viser 1.1.1 runs plain functions on several threads, where the phases may overtake each other.
    The start position of later events follows the node, so the first one is kept.
    """
    start = np.zeros(3)

    async def dragged(event: Any) -> None:
        nonlocal start
        if event.phase == "start":
            start = np.array(event.start_position)
        call(event.phase, np.array(event.end_position) - start)

    node.on_drag("left")(dragged)


class BackgroundClicks:
    """Clicks that hit no node.

    viser 1.1.1 reports a click on a node twice: for the node, then for the scene, with the same position. Every
    clickable node has to be registered by `ignore_clicks_on`.
    """

    def __init__(self, client: viser.ClientHandle, on_click: Callable[[viser.SceneClickEvent], None]) -> None:
        self._on_click = on_click
        self._node_click_at: tuple[float, float] | None = None  # position in the window, 0 to 1

        async def scene_clicked(event: viser.SceneClickEvent) -> None:  # a coroutine, so that the order is kept
            self._scene_clicked(event)

        listen: Any = client.scene.on_click()  # its type does not name coroutines
        listen(scene_clicked)

    def ignore_clicks_on(self, node: ClickableNode) -> None:
        """A click on this node is no click on the background."""

        async def node_clicked(event: viser.SceneNodePointerEvent) -> None:
            self._node_click_at = event.screen_pos

        node.on_click(node_clicked)

    def _scene_clicked(self, event: viser.SceneClickEvent) -> None:
        is_on_node, self._node_click_at = event.screen_pos == self._node_click_at, None
        if not is_on_node:
            self._on_click(event)
