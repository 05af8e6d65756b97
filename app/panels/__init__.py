"""Panels: the controls and read-outs around the 3D view, one class per panel.

Belongs here: every panel of the debugger page (HTML and widgets), the caches of what a panel displays, and the SVG
charts that panels draw.

May import: viser, `app.viser_bridge`, `app.page_state`, `app.pictures`, `app.debugger`, `app.experiments`,
`app.lessons`, the loose modules of `app`, and `fairing`. Not `app.layers`, and not `app.page`, which creates the panels.

Offers: classes with the interface `Panel`. Each instance serves one browser; its handles are created in `__init__`.
"""

from typing import Protocol

from app.debugger.run_state import RunState
from app.page_state.page_state import PageState


class Panel(Protocol):
    """One panel of one browser."""

    def show(self, state: RunState, page_state: PageState) -> None:
        """Update the panel in the browser."""
        ...
