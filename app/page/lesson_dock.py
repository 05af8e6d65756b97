"""Lesson dock: the list of lessons beside the cells, the open lesson docked above them, and their hotkeys."""

from collections.abc import Callable

import viser

from app.debugger.actions import KEY_LABELS
from app.debugger.commands import Pause
from app.debugger.controller import Controller
from app.debugger.run_state import RunState
from app.lessons.lesson import ANY_SCENE, Lesson
from app.lessons.player import Player
from app.lessons.progress import LastLesson
from app.lessons.reader import lesson_names, load_lesson
from app.lessons.scenes import LESSON_SCENES, is_lesson_scene
from app.lessons.settings_applier import SettingsApplier
from app.page.page_frame import Hotkey
from app.page.resources import ChangeScene
from app.page_state.page_state import PageState
from app.panels.lesson_panel import LessonPanel
from app.panels.lessons_panel import LessonsPanel
from app.viser_bridge.error_toasts import NothingToDo
from app.viser_bridge.html_events import HtmlEvents
from app.viser_bridge.html_panel import HtmlPanel
from app.viser_bridge.tabs import show_heading, show_tab, show_top

BACK_KEY, NEXT_KEY = "PageUp", "PageDown"
STAND_IN = "archway"  # offered in place of a capture
_LEAVES_RUNS = "This lesson uses another scene. The runs on this scene are closed; they are lost unless they are saved (--save-to)."
_ON_A_CAPTURE = (
    "This lesson is about real photographs. Open your own, in any format that <code>eigenfairing check</code> "
    "understands, by<br><code>eigenfairing view CAPTURE --lesson capture</code><br>"
    "The demo archway can take its place: its mesh is made of noisy points, too."
)


class LessonDock:
    """Args:
    lead_eye: moves the browser's camera, see `SettingsApplier`.
    change_scene: shows another scene of the lessons, and opens a lesson there; see `SessionResources`.
    last_lesson: kept up to date with the lesson of this page.
    on_open: called when a lesson has been opened, with True, or closed, with False.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        controller: Controller,
        html_events: HtmlEvents,
        lead_eye: Callable[[str | int], None],
        change_scene: ChangeScene,
        last_lesson: LastLesson,
        on_open: Callable[[bool], None],
    ) -> None:
        self._client, self._controller, self._html_events = client, controller, html_events
        self._change_scene, self._last_lesson, self._on_open = change_scene, last_lesson, on_open
        self.player = Player(controller, self._changed)
        self._lessons = [load_lesson(name) for name in lesson_names()]
        self._settings_applier = SettingsApplier(
            self.player,
            lead_eye,
            lambda title: show_tab(client, title),
            lambda title: show_heading(client, title),
            lambda: show_top(client, ".ef .pages"),
        )
        self._open = {name: html_events.button(lambda name=name: self.open(name)) for name in lesson_names()}

    def build(self, cells: viser.PanelHandle) -> list[LessonsPanel | LessonPanel]:
        """Add a tab with the list to the panel of the cells, and above that the open lesson, hidden until there is one."""
        with cells.add_tab("Lessons", viser.Icon.SCHOOL):
            resume = self._html_events.button(self.resume)
            listed = LessonsPanel(self._client.gui, self.player, self._open, self._lessons, self._last_lesson, resume)
        self._panel = self._client.gui.add_panel(visible=False)
        with self._panel.add_tab("Lesson", viser.Icon.SCHOOL):
            opened = LessonPanel(
                self._client.gui,
                self._html_events,
                self.player,
                self._open_following,
                lambda: self._controller.post(Pause()),
            )
        self._panel.dock_above(cells)
        return [listed, opened]

    def open(self, name: str) -> None:
        """Begin a lesson. If it uses another scene, open that, after a confirmation if runs on this one would be closed."""
        lesson = load_lesson(name)
        if lesson.scene == ANY_SCENE and is_lesson_scene("cube", self._controller.scene):
            self._offer(lesson.name, STAND_IN, _ON_A_CAPTURE, "Stay with the cube", lambda: self._begin(lesson))
        elif self.player.fits(lesson):
            self._begin(lesson)
        elif self.player.lesson is None and any(run.length for run in self._controller.state.runs):
            self._offer(lesson.name, lesson.scene, _LEAVES_RUNS, "Stay here", lambda: None)
        else:
            self._change_scene(self._client, lesson.scene, name)

    def resume(self) -> None:
        """Go on with the lesson that was open in a page that has gone."""
        progress = self._last_lesson.progress
        if progress is None or self.player.lesson is not None:
            raise NothingToDo("no lesson was left open; choose one under Lessons")
        self.player.resume(progress)
        show_tab(self._client, "Cells")

    def close(self) -> None:
        """The browser has disconnected; its lesson can be resumed in another page."""
        self.player.leave()

    def open_scene(self, name: str) -> None:
        """Open another scene, after a confirmation if runs on this one would be closed."""
        if is_lesson_scene(name, self._controller.scene):
            raise NothingToDo(f"{LESSON_SCENES[name].title} is open")
        if any(run.length for run in self._controller.state.runs):
            self._offer("", name, _LEAVES_RUNS.replace("This lesson uses", "This opens"), "Stay here", lambda: None)
        else:
            self._change_scene(self._client, name, "")

    def _changed(self) -> None:
        self._last_lesson.progress = self.player.progress
        self._controller.republish()

    def _begin(self, lesson: Lesson) -> None:
        self.player.open(lesson)
        show_tab(self._client, "Cells")

    def _offer(self, lesson: str, scene: str, why: str, otherwise: str, do_otherwise: Callable[[], None]) -> None:
        """Ask the user whether to open another scene, for a lesson if one is named."""
        gui, title = self._client.gui, LESSON_SCENES[scene].title
        with gui.add_modal(f"Open {title}?") as modal:
            HtmlPanel(gui, why)
            choices = [
                (gui.add_button(f"Open {title}"), lambda: self._change_scene(self._client, scene, lesson)),
                (gui.add_button(otherwise), do_otherwise),
            ]

        def chosen(do: Callable[[], None]) -> None:
            modal.close()
            do()

        for button, do in choices:
            call = self._html_events.guarded(chosen)
            button.on_click(lambda _, call=call, do=do: call(do))

    def _open_following(self) -> None:
        """Open the lesson after the present one; after the last, and after one that is not listed, the first."""
        names = lesson_names()
        if self.player.lesson is not None:
            following = names.index(self.player.lesson.name) + 1 if self.player.lesson.name in names else 0
            self.open(names[following % len(names)])

    def hotkeys(self) -> list[Hotkey]:
        """The hotkeys within a lesson, and a palette entry for each lesson."""
        opening = [Hotkey(f"Lesson: {lesson.title}", lambda n=lesson.name: self.open(n)) for lesson in self._lessons]
        return [
            *opening,
            Hotkey("Resume the lesson that was left", self.resume),
            Hotkey(KEY_LABELS["Page Down"], lambda: self._in_lesson(self.player.next), NEXT_KEY),
            Hotkey(KEY_LABELS["Page Up"], lambda: self._in_lesson(self.player.back), BACK_KEY),
        ]

    def _in_lesson(self, call: Callable[[], None]) -> None:
        if self.player.lesson is None:
            raise NothingToDo("no lesson is open; choose one under Lessons")
        call()

    def show(self, state: RunState, view: PageState) -> None:
        """Apply the settings of the lesson's step; to be called before layers and panels are shown."""
        self._settings_applier.show(state, view)
        is_open = self.player.lesson is not None
        if self._panel.visible != is_open:
            self._panel.visible = is_open
            self._on_open(is_open)
