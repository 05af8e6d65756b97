"""What stands in the 3D view, one class a layer; each knows how to show a state to one browser."""

from typing import Protocol

from app.debugger.run_state import RunState
from app.page_state.page_state import PageState


class Layer(Protocol):
    """Something in the 3D view."""

    def show(self, state: RunState, page_state: PageState) -> None:
        """Bring the browser up to date."""
        ...
