"""What stands around the 3D view, one class a panel; each knows how to show a state to one browser."""

from typing import Protocol

from app.debugger.run_state import RunState
from app.page_state.page_state import PageState


class Panel(Protocol):
    """Something beside the 3D view."""

    def show(self, state: RunState, page_state: PageState) -> None:
        """Bring the browser up to date."""
        ...
