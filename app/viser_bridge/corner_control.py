"""A place in the scene that is moved by three arrows, along the axes of the scene."""

from collections.abc import Callable
from typing import Any

import numpy as np
import viser


class CornerControl:
    """Three arrows and three squares, hidden at first.

    Callbacks are coroutines, because viser 1.1.1 runs plain functions on several threads, where the last place may be overtaken.

    Args:
        name: of the node in the scene tree.
        size: length of the arrows, scene units.
        on_move: called with the place (3,), scene units, while it is dragged.
        on_drop: called when a drag ends.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        name: str,
        size: float,
        on_move: Callable[[np.ndarray], None],
        on_drop: Callable[[], None],
    ) -> None:
        self._control = control = client.scene.add_transform_controls(
            name, scale=size, disable_rotations=True, depth_test=False, visible=False
        )

        async def moved(event: viser.TransformControlsEvent) -> None:
            place = np.array(control.position)
            if event.phase == "end":
                on_drop()
            elif np.isfinite(place).all():  # a browser can send anything
                on_move(place)

        listen: Any = control.on_update  # its type does not name coroutines
        listen(moved)

    def show(self, place: np.ndarray | None) -> None:
        """Show the arrows at a place (3,), scene units; None hides them."""
        if place is not None and not np.array_equal(self._control.position, place):
            self._control.position = place
        if self._control.visible != (place is not None):
            self._control.visible = place is not None
