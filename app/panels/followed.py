"""A widget that the user moves and that follows the page where the page itself has changed."""

from typing import Any


class Followed:
    """Args:
    handle: of a slider. It differs from the page as long as what the user did is on its way: only what is new in the
        page is written into it.
    """

    def __init__(self, handle: Any) -> None:
        self._handle, self._newest = handle, handle.value

    def follow(self, value: float) -> None:
        """The page has this value."""
        if value != self._newest:
            self._newest = value
            self._handle.value = value
