"""Plugins of a page: layers and panels that other installed packages offer by entry points.

A layer is made by `make(client, stage, scene)`, a panel by `make(gui, controller)` in a tab with the name of its entry point. What
either raises is shown as a message; the rest of the page goes on.
"""

from collections.abc import Callable
from typing import Any

import viser

from app.debugger.controller import Controller
from app.debugger.run_state import RunState
from app.layers import Layer
from app.page_state.page_state import PageState
from app.panels import Panel
from app.stage import Stage
from app.viser_bridge.error_toasts import ErrorToasts
from fairing.scene import Scene
from fairing.util.plugins import offered

LAYERS, PANELS = "eigenfairing.layers", "eigenfairing.panels"


def offered_layers(client: viser.ClientHandle, stage: Stage, scene: Scene, toasts: ErrorToasts) -> list[Layer]:
    """The layers of other packages.

    Raises:
        InputError: one of them cannot be loaded.
    """
    return [_Guarded(lambda make=make: make(client, stage, scene), toasts) for make in offered(LAYERS).values()]


def offered_panels(
    gui: viser.GuiApi, tabs: viser.GuiTabGroupHandle, controller: Controller, toasts: ErrorToasts
) -> list[Panel]:
    """The panels of other packages, each in a new tab.

    Raises:
        InputError: one of them cannot be loaded.
    """
    panels: list[Panel] = []
    for name, make in offered(PANELS).items():
        with tabs.add_tab(name):
            panels.append(_Guarded(lambda make=make: make(gui, controller), toasts))
    return panels


class _Guarded:
    """A layer or a panel that shows what it raises, or nothing if it cannot be made."""

    def __init__(self, make: Callable[[], Any], toasts: ErrorToasts) -> None:
        self._part: Any = None
        toasts(lambda: setattr(self, "_part", make()))()
        self._show = toasts(self._show_part)

    def show(self, state: RunState, page_state: PageState) -> None:
        """Update it in the browser."""
        self._show(state, page_state)

    def _show_part(self, state: RunState, page_state: PageState) -> None:
        if self._part is not None:
            self._part.show(state, page_state)
