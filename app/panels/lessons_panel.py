"""Lessons panel: the list of lessons."""

import viser

from app.debugger.run_state import RunState
from app.html import button, text
from app.lessons.lesson import Lesson
from app.lessons.player import Player
from app.lessons.progress import LastLesson
from app.lessons.scenes import LESSON_SCENES
from app.page_state.page_state import PageState
from app.viser_bridge.html_panel import HtmlPanel


class LessonsPanel:
    """One button per lesson, and above them one that resumes the lesson of a page that has gone.

    Args:
        press: JavaScript that opens a lesson, by its name.
        resume: JavaScript that goes on with the last lesson.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        player: Player,
        press: dict[str, str],
        lessons: list[Lesson],
        last_lesson: LastLesson,
        resume: str,
    ) -> None:
        self._player, self._press, self._lessons = player, press, lessons
        self._last_lesson, self._resume = last_lesson, resume
        self._panel = HtmlPanel(gui)

    def show(self, state: RunState, page_state: PageState) -> None:
        rows = "".join(self._row(n, lesson) for n, lesson in enumerate(self._lessons, 1))
        self._panel.set(f"<div class='lessons'>{self._left()}{rows}</div>")

    def _left(self) -> str:
        """A button that goes on with the lesson that was left; nothing while a lesson is open."""
        progress = self._last_lesson.progress
        if progress is None or self._player.lesson is not None:
            return ""
        at = f"step {progress.step + 1} of {len(progress.lesson.steps)}"
        label = f"<span class='big'>Resume: {text(progress.lesson.title)}</span><br>{at}"
        return button("", self._resume, hint="Go on with the lesson where it was left", content=label, css_class="on")

    def _row(self, n: int, lesson: Lesson) -> str:
        is_open = self._player.lesson is not None and self._player.lesson.name == lesson.name
        where = "" if self._player.fits(lesson) else f" · opens {LESSON_SCENES[lesson.scene].title}"
        label = (
            f"<span class='big'>{n} · {text(lesson.title)}</span><br><span class='dim'>{text(lesson.about)} "
            f"{len(lesson.steps)} steps{text(where)}</span>"
        )
        css_class = "on" if is_open else ""
        return button("", self._press[lesson.name], hint=f"Lesson: {lesson.title}", content=label, css_class=css_class)
