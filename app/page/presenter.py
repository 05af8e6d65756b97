"""Presenter layout: large text and pictures at the left, the step buttons and the residual at the right, for an audience."""

from collections.abc import Callable

from app.page_state.page_state import PageState
from app.viser_bridge.presenter_style import PresenterStyle


class Presenter:
    """The layout of one browser. A lesson switches it on, and off again at its end unless the user has switched meanwhile."""

    def __init__(self, page_state: PageState, style: PresenterStyle, republish: Callable[[], None]) -> None:
        self._page_state, self._style, self._republish = page_state, style, republish
        self._is_for_lesson = False

    def switch(self) -> None:
        """Switch to the presenter layout, or back."""
        self._is_for_lesson = False
        self._set(not self._page_state.is_presenting)
        self._republish()

    def follow_lesson(self, is_open: bool) -> None:
        """A lesson has been opened or closed. To be called before panels are shown."""
        if is_open and not self._page_state.is_presenting:
            self._is_for_lesson = True
            self._set(True)
        elif not is_open and self._is_for_lesson:
            self._is_for_lesson = False
            self._set(False)

    def _set(self, is_on: bool) -> None:
        self._page_state.is_presenting = is_on
        self._style.set(is_on)
