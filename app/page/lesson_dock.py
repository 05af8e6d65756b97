"""The lessons on one page: the list beside the cells, the open lesson docked above them, keys and palette entries."""

from collections.abc import Callable

import viser

from app.debugger.commands import Pause
from app.debugger.controller import Controller
from app.debugger.run_state import RunState
from app.lessons.lesson import ANY_SCENE, Lesson
from app.lessons.player import Player
from app.lessons.reader import lesson_names, load_lesson
from app.lessons.scenes import LESSON_SCENES, is_at_hand
from app.lessons.settings_applier import SettingsApplier
from app.page_state.page_state import PageState
from app.panels.lesson_panel import LessonPanel, LessonPresses
from app.panels.lessons_panel import LessonsPanel
from app.viser_bridge.html_events import Bridge
from app.viser_bridge.html_panel import HtmlPanel
from app.viser_bridge.tabs import show_heading, show_tab

BACK_KEY, NEXT_KEY = "PageUp", "PageDown"
STAND_IN = "archway"  # for photos of one's own
_LEAVES_RUNS = "This lesson plays on another scene. What was recorded on this one is left, unless it is kept in a file (--save-to)."
_ON_A_CAPTURE = (
    "This lesson is about real photographs. Open your own, in any format that <code>eigenfairing check</code> "
    "understands, by<br><code>eigenfairing view CAPTURE --lesson capture</code><br>"
    "The demo archway may stand in for them: its mesh is made of noisy points, as theirs would be."
)


class LessonRoom:
    """Args:
    lead_eye: moves the browser's camera, see `SettingsApplier`.
    change_scene: shows a scene of the lessons instead, and opens a lesson there.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        controller: Controller,
        bridge: Bridge,
        guarded: Callable[[Callable[..., None]], Callable[..., None]],
        lead_eye: Callable[[str | int], None],
        change_scene: Callable[[viser.ClientHandle, str, str], None],
    ) -> None:
        self._client, self._controller, self._guarded = client, controller, guarded
        self._change_scene = change_scene
        self.player = Player(controller, controller.republish)
        self._lessons = [load_lesson(name) for name in lesson_names()]
        self._settings_applier = SettingsApplier(
            self.player, lead_eye, lambda title: show_tab(client, title), lambda title: show_heading(client, title)
        )
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
        """Begin a lesson; if it plays on another scene, open that, but ask first if runs on this one would be left."""
        lesson = load_lesson(name)
        if lesson.scene == ANY_SCENE and is_at_hand("cube", self._controller.scene):
            self._offer(lesson, STAND_IN, _ON_A_CAPTURE, "Stay with the cube", lambda: self._begin(lesson))
        elif self.player.fits(lesson):
            self._begin(lesson)
        elif self.player.lesson is None and any(run.length for run in self._controller.state.runs):
            self._offer(lesson, lesson.scene, _LEAVES_RUNS, "Stay here", lambda: None)
        else:
            self._change_scene(self._client, lesson.scene, name)

    def _begin(self, lesson: Lesson) -> None:
        self.player.open(lesson)
        show_tab(self._client, "Cells")

    def _offer(self, lesson: Lesson, scene: str, why: str, otherwise: str, do_otherwise: Callable[[], None]) -> None:
        """Query whether to open another scene for a lesson."""
        gui, title = self._client.gui, LESSON_SCENES[scene].title
        with gui.add_modal(f"Open {title}?") as modal:
            HtmlPanel(gui, why)
            choices = [
                (gui.add_button(f"Open {title}"), lambda: self._change_scene(self._client, scene, lesson.name)),
                (gui.add_button(otherwise), do_otherwise),
            ]

        def chosen(do: Callable[[], None]) -> None:
            modal.close()
            do()

        for button, do in choices:
            call = self._guarded(chosen)
            button.on_click(lambda _, call=call, do=do: call(do))

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

    def show(self, state: RunState, view: PageState) -> None:
        """Before layers and panels: lead the page where the lesson wants it."""
        self._settings_applier.show(state, view)
        is_open = self.player.lesson is not None
        if self._panel.visible != is_open:
            self._panel.visible = is_open
