"""Settings applier: applies the page settings of a lesson step (selection, surface, layers, camera, tab) to a browser."""

from collections.abc import Callable

from app.debugger.run_state import RunState
from app.lessons.page_settings import PageSettings
from app.lessons.player import Player
from app.page_state.page_state import PageState


class SettingsApplier:
    """Applies settings once per lesson step. Changes by the user afterwards are kept.

    Args:
        lead_eye: moves the browser's camera: to AT_MESH, AT_FRONT, AT_CAMERAS or into a photo.
        show_tab: brings a tab to the front.
        show_heading: scrolls to a heading of the cells.
        show_top: scrolls to the top of the panel with the cells, where the other pages have their pictures.
    """

    def __init__(
        self,
        player: Player,
        lead_eye: Callable[[str | int], None],
        show_tab: Callable[[str], None],
        show_heading: Callable[[str], None],
        show_top: Callable[[], None],
    ) -> None:
        self._player, self._lead_eye = player, lead_eye
        self._show_tab, self._show_heading, self._show_top = show_tab, show_heading, show_top
        self._last = PageSettings()

    def show(self, state: RunState, page_state: PageState) -> None:
        """Apply the settings that are due, if any. Call it before updating layers and panels."""
        due = self._player.take_settings()
        if due is None:
            return
        settings, again = due
        settings.set_in(page_state)
        reference = self._player.reference(settings)
        if settings.compared == "" or reference is not None:
            page_state.reference = reference
        if settings.eye is not None and (again or settings.eye != self._last.eye):
            self._lead_eye(settings.eye)
        if settings.tab is not None and (again or settings.tab != self._last.tab):
            self._show_tab(settings.tab)
        if settings.cells.get("page", "cells") != "cells":
            self._show_top()
        elif settings.heading is not None:  # at every step: the panel may have been redrawn while the engine ran
            self._show_heading(settings.heading)
        self._last = settings
