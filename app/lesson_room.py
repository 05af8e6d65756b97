"""The lessons on one page: the list beside the cells, the open lesson docked above them, keys and palette entries."""

from collections.abc import Callable

import viser

from app.bridge import Bridge
from app.commands import Pause
from app.controller import Controller
from app.lessons.guide import Guide
from app.lessons.player import Player
from app.lessons.reader import lesson_names, load_lesson
from app.panels.lesson_panel import LessonPanel, LessonPresses
from app.panels.lessons_panel import LessonsPanel
from app.run_state import RunState
from app.tabs import show_tab
from app.view import View

BACK_KEY, NEXT_KEY = "PageUp", "PageDown"


class LessonRoom:
    """Args: lead_eye: moves the browser's camera, see `Guide`."""

    def __init__(
        self, client: viser.ClientHandle, controller: Controller, bridge: Bridge, lead_eye: Callable[[str | int], None]
    ) -> None:
        self._client = client
        self.player = Player(controller, controller.republish)
        self._lessons = [load_lesson(name) for name in lesson_names()]
        self._guide = Guide(self.player, lead_eye, lambda title: show_tab(client, title))
        self._press = LessonPresses.make(bridge, self.player, self._open_following, lambda: controller.post(Pause()))
        self._open = {name: bridge.button(lambda name=name: self.open(name)) for name in lesson_names()}

    def build(self, cells: viser.PanelHandle) -> list[LessonsPanel | LessonPanel]:
        """A tab with the list in the panel of the cells, and above that the open lesson, hidden until there is one."""
        with cells.add_tab("Lessons", viser.Icon.SCHOOL):
            listed = LessonsPanel(self._client.gui, self.player, self._open, self._lessons)
        self._panel = self._client.gui.add_panel(visible=False)
        with self._panel.add_tab("Lesson", viser.Icon.SCHOOL):
            opened = LessonPanel(self._client.gui, self.player, self._press)
        self._panel.dock_above(cells)
        return [listed, opened]

    def open(self, name: str) -> None:
        """Begin a lesson.

        Raises:
            InputError: it plays on another scene.
        """
        self.player.open(load_lesson(name))
        show_tab(self._client, "Cells")

    def _open_following(self) -> None:
        """The lesson after the present one; after the last, the first."""
        names = lesson_names()
        if self.player.lesson is not None:
            self.open(names[(names.index(self.player.lesson.name) + 1) % len(names)])

    def commands(self) -> list[tuple[str, Callable[[], None], str | None]]:
        """For keys and the palette: label, call and key."""
        opening = [(f"Lesson: {lesson.title}", lambda n=lesson.name: self.open(n), None) for lesson in self._lessons]
        turning = [
            ("Next step of the lesson", self.player.next, NEXT_KEY),
            ("Back one step of the lesson", self.player.back, BACK_KEY),
        ]
        return [*opening, *turning]

    def show(self, state: RunState, view: View) -> None:
        """Before layers and panels: lead the page where the lesson wants it."""
        self._guide.show(state, view)
        is_open = self.player.lesson is not None
        if self._panel.visible != is_open:
            self._panel.visible = is_open
