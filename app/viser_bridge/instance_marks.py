"""Instances of one shape, of which some are shown, and which can be clicked."""

from collections.abc import Callable

import numpy as np
import viser

from app.viser_bridge.linear_colors import linear_from_srgb
from app.viser_bridge.node_events import on_node_click


class InstanceMarks:
    """One node with an instance for every position; those that are hidden have zero size.

    viser 1.1.1 makes a node anew when its number of instances changes, and a click on it before the browser has its
    bindings is lost, so the number never changes.

    Args:
        shape: vertices (v, 3) float and faces (f, 3) of an instance.
        positions: (n, 3) float, scene units, at first.
        on_click: called with the index of an instance and whether Shift was held.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        name: str,
        shape: tuple[np.ndarray, np.ndarray],
        positions: np.ndarray,
        on_click: Callable[[int, bool], None],
    ) -> None:
        count = len(positions)
        self.node = client.scene.add_batched_meshes_simple(
            name,
            *shape,
            np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
            positions,
            batched_scales=np.zeros(count, dtype=np.float32),
            batched_colors=np.zeros((count, 3), dtype=np.uint8),
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
            visible=False,
        )

        def clicked(event: viser.SceneNodePointerEvent, with_shift: bool) -> None:
            if event.instance_index is not None and 0 <= event.instance_index < count:
                on_click(event.instance_index, with_shift)

        on_node_click(self.node, clicked)

    def show(
        self, shown: np.ndarray, positions: np.ndarray, colors: np.ndarray, scales: np.ndarray, is_visible: bool
    ) -> None:
        """Draw the instances of `shown` (n,) bool; positions (n, 3) and scales (n,) in scene units, colors (n, 3) uint8."""
        is_visible = is_visible and bool(shown.any())
        if is_visible:
            self.node.batched_positions = positions
            self.node.batched_colors = linear_from_srgb(colors)
            self.node.batched_scales = np.where(shown, scales, np.float32(0))
        self.node.visible = is_visible
