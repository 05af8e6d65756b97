"""Line segments in the colour of the selection, in one scene node that is hidden when there are none."""

import numpy as np
import viser

from app.palette import SELECTED


class Lines:
    """A node of line segments.

    Args:
        name: of the node in the scene tree.
        thickness: screen px.
    """

    def __init__(self, client: viser.ClientHandle, name: str, thickness: float) -> None:
        self._node = client.scene.add_line_segments(
            name,
            np.zeros((1, 2, 3), dtype=np.float32),
            SELECTED,
            thickness=thickness,
            thickness_units="screen",
            visible=False,
        )

    def show(self, points: np.ndarray | None) -> None:
        """Draw lines (n, 2, 3), page units; None hides them."""
        if points is not None:
            self._node.points = points
        if self._node.visible != (points is not None):
            self._node.visible = points is not None
