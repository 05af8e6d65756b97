"""A ring around a point, of the same size on the screen from any distance, in front of everything.

viser 1.1.1 has lines of constant thickness on the screen, but no shapes of constant size, and hides lines behind surfaces.
"""

import numpy as np
import viser

from app.viser_bridge.javascript import run_in_page

CORNERS = 48  # of the polygon: its edges are 2 px long at a radius of 15 px


class ScreenRing:
    """A ring, hidden at first.

    Args:
        radius, thickness: screen px.
    """

    def __init__(
        self, client: viser.ClientHandle, name: str, color: tuple[int, int, int], radius: float, thickness: float
    ) -> None:
        angle = np.linspace(0, 2 * np.pi, CORNERS + 1)
        circle = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
        segments = np.stack([circle[:-1], circle[1:]], axis=1).astype(np.float32)
        self._node = client.scene.add_line_segments(
            name, segments, color, thickness=thickness, thickness_units="screen", visible=False
        )
        run_in_page(client.gui, "screen_ring", "keepRingSize", name=name, radius=radius)

    def show(self, position: np.ndarray | None) -> None:
        """Draw the ring around a position (3,), scene units; None hides it."""
        if position is not None:
            self._node.position = position
        self._node.visible = position is not None
