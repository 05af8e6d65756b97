"""Brings one browser's page to where a lesson's step wants it: selection, surface, layers, camera, comparison, tab."""

from collections.abc import Callable

from app.debugger.run_state import RunState
from app.lessons.look import Look
from app.lessons.player import Player
from app.page_state.page_state import PageState


class Guide:
    """Touches the page once a step; what users change afterwards stays as they have it.

    Args:
        lead_eye: moves the browser's camera: to AT_MESH, AT_FRONT, AT_CAMERAS or into a photo.
        show_tab: brings a tab to the front.
        show_heading: scrolls to a heading.
    """

    def __init__(
        self,
        player: Player,
        lead_eye: Callable[[str | int], None],
        show_tab: Callable[[str], None],
        show_heading: Callable[[str], None],
    ) -> None:
        self._player, self._lead_eye = player, lead_eye
        self._show_tab, self._show_heading = show_tab, show_heading
        self._last = Look()

    def show(self, state: RunState, view: PageState) -> None:
        """To be called before the layers and panels are shown."""
        due = self._player.take_look()
        if due is None:
            return
        look, again = due
        look.set_in(view)
        reference = self._player.reference(look)
        if look.compared == "" or reference is not None:
            view.reference = reference
        if look.eye is not None and (again or look.eye != self._last.eye):
            self._lead_eye(look.eye)
        if look.tab is not None and (again or look.tab != self._last.tab):
            self._show_tab(look.tab)
        if look.heading is not None:  # at every step: while the engine worked, the panel may have been drawn anew
            self._show_heading(look.heading)
        self._last = look
