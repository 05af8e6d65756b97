"""Widgets that the user changes and that the page changes, too."""

from collections.abc import Callable
from typing import Any

import viser


def on_user_change(handle: Any, call: Callable[[Any], None]) -> None:
    """Call with the widget's value when a user has changed it.

    viser 1.1.1 also calls the callbacks of a widget when Python assigns its value; those have no client.
    """

    @handle.on_update
    def _(event: viser.GuiEvent) -> None:
        if event.client is not None:
            call(handle.value)


class SyncedSlider:
    """A slider that follows a value of the page.

    While a user's change is on its way the slider differs from the page, so only a changed value is written into it.

    Args:
        handle: the slider.
        on_move: called with its value when a user has moved it.
    """

    def __init__(self, handle: Any, on_move: Callable[[Any], None]) -> None:
        self._handle, self._newest = handle, handle.value
        on_user_change(handle, on_move)

    def follow(self, value: float) -> None:
        """Show the page's value."""
        if value != self._newest:
            self._newest = value
            self._handle.value = value
