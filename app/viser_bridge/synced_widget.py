"""A widget that the user moves and that follows the page where the page itself has changed."""

from collections.abc import Callable
from typing import Any

import viser


class Followed:
    """Args:
    handle: of a slider. It differs from the page as long as what the user did is on its way: only what is new in the
        page is written into it.
    on_move: told of its value when a user has moved it.
    """

    def __init__(self, handle: Any, on_move: Callable[[Any], None]) -> None:
        self._handle, self._newest = handle, handle.value

        @handle.on_update
        def _(event: viser.GuiEvent) -> None:
            if event.client is not None:
                on_move(handle.value)

    def follow(self, value: float) -> None:
        """The page has this value."""
        if value != self._newest:
            self._newest = value
            self._handle.value = value
