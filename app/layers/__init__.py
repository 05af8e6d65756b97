"""What stands in the 3D view, one class a layer; each knows how to show a state to one browser."""

from typing import Protocol

from app.run_state import RunState
from app.view import View


class Layer(Protocol):
    """Something in the 3D view."""

    def show(self, state: RunState, view: View) -> None:
        """Bring the browser up to date."""
        ...
