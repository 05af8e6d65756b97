"""Lessons panel: the list of lessons."""

import viser

from app.debugger.run_state import RunState
from app.html import button, text
from app.lessons.lesson import Lesson
from app.lessons.player import Player
from app.lessons.scenes import LESSON_SCENES
from app.page_state.page_state import PageState
from app.viser_bridge.html_panel import HtmlPanel


class LessonsPanel:
    """One button per lesson.

    Args:
        press: JavaScript that opens a lesson, by its name.
    """

    def __init__(self, gui: viser.GuiApi, player: Player, press: dict[str, str], lessons: list[Lesson]) -> None:
        self._player, self._press, self._lessons = player, press, lessons
        self._panel = HtmlPanel(gui)

    def show(self, state: RunState, page_state: PageState) -> None:
        rows = "".join(self._row(n, lesson) for n, lesson in enumerate(self._lessons, 1))
        self._panel.set(f"<div class='lessons'>{rows}</div>")

    def _row(self, n: int, lesson: Lesson) -> str:
        is_open = self._player.lesson is not None and self._player.lesson.name == lesson.name
        where = "" if self._player.fits(lesson) else f" · opens {LESSON_SCENES[lesson.scene].title}"
        label = (
            f"<span class='big'>{n} · {text(lesson.title)}</span><br><span class='dim'>{text(lesson.about)} "
            f"{len(lesson.steps)} steps{text(where)}</span>"
        )
        css_class = "on" if is_open else ""
        return button("", self._press[lesson.name], hint=f"Lesson: {lesson.title}", content=label, css_class=css_class)
