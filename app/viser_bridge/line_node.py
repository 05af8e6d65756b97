"""A node of line segments that may be empty."""

import numpy as np
import viser

from app.viser_bridge.javascript import run_in_page
from app.viser_bridge.linear_colors import linear_from_srgb


class LineNode:
    """Line segments of one thickness. viser 1.1.1 fails in the browser on a node without segments, so it is hidden then.

    Args:
        name: of the node in the scene tree.
        color: of all segments; None: `show` gets one for each end.
        thickness: screen px.
        in_front: draw the segments in front of all surfaces.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        name: str,
        color: tuple[int, int, int] | None,
        thickness: float,
        in_front: bool = False,
    ) -> None:
        self._node = client.scene.add_line_segments(
            name,
            np.zeros((1, 2, 3), dtype=np.float32),
            np.zeros((1, 2, 3), dtype=np.uint8) if color is None else color,
            thickness=thickness,
            thickness_units="screen",
            visible=False,
        )
        if in_front:
            run_in_page(client.gui, "line_node", "drawInFront", name=name)

    def show(self, points: np.ndarray | None, colors: np.ndarray | None = None) -> None:
        """Draw segments (n, 2, 3) float, scene units, with colors (n, 2, 3) uint8; None or n = 0 hides the node."""
        is_visible = points is not None and len(points) > 0
        if points is not None and is_visible:
            self._node.points = points
            if colors is not None:
                self._node.colors = linear_from_srgb(colors)
        if self._node.visible != is_visible:
            self._node.visible = is_visible

    def hide(self) -> None:
        self.show(None)
