"""One browser's page: its panels, layers, camera and selection. All pages of a session show the same runs."""

from collections.abc import Callable
from functools import partial

import viser

from app.debugger.actions import ACTIONS, KEY_LABELS, key_list
from app.debugger.compare import Reference
from app.debugger.run_state import RunState
from app.lessons.page_settings import AT_CAMERAS, AT_FRONT, AT_MESH
from app.page.lesson_dock import LessonDock
from app.page.page_frame import Hotkey, PageFrame
from app.page.page_layers import PageLayers
from app.page.page_panels import PagePanels
from app.page.page_updates import PageUpdates
from app.page.palette_entries import export_entries, option_entries, scene_entries, view_entries
from app.page.resources import SessionResources
from app.page.vertex_interaction import VertexInteraction
from app.page_state.association_source import AssociationSource
from app.page_state.certainty_source import CertaintySource
from app.page_state.page_state import PageState
from app.page_state.past_moment import at_viewed_moment
from app.page_state.pull_source import PullSource
from app.page_state.run_controls import RunControls
from app.panels.keys_dialog import KeysDialog


class Page:
    """Builds everything on connection; afterwards only `show` and the user's actions change it.

    Attributes:
        page_state: what this browser shows.
    """

    def __init__(self, client: viser.ClientHandle, resources: SessionResources, page_state: PageState) -> None:
        self.page_state = page_state
        self._client, self._resources = client, resources
        controller, stage, scene = resources.controller, resources.stage, resources.scene
        self._problems = controller.state.problems
        self._updates: PageUpdates | None = None
        self._unsubscribe: Callable[[], None] = lambda: None
        self.frame = PageFrame(client, scene.name, stage, scene, self._camera_changed, controller.republish)
        self.camera = self.frame.camera
        events, toasts = self.frame.html_events, self.frame.toasts
        self.run_controls = RunControls(controller, page_state)
        self.interaction = VertexInteraction(client, stage, scene, controller, page_state, toasts)
        self.lessons = LessonDock(
            client, controller, events, self._look_for_lesson, resources.change_scene, resources.last_lesson,
            lambda is_open: self.panels.presenter.follow_lesson(is_open),
        )  # fmt: skip
        certainty, pulls = CertaintySource(controller), PullSource(controller)
        associations = AssociationSource(controller)
        self.panels = PagePanels(
            client,
            self.frame,
            resources,
            page_state,
            self.run_controls,
            self.interaction,
            certainty,
            pulls,
            associations,
            self.lessons,
        )
        self.layers = PageLayers(
            client, self.frame, resources, self.interaction, certainty, pulls, associations, page_state
        )
        self._order = ""
        self._keys_dialog = KeysDialog(client.gui, events)
        self.frame.add_hotkeys(
            [
                *self._hotkeys(),
                *self.frame.camera_hotkeys(),
                *self.lessons.hotkeys(),
                *view_entries(client, scene, page_state, controller.republish),
                *option_entries(client, controller, self.panels.runs.compare_presets),
                *export_entries(self.panels.show_result, self.panels.sharing.make),
                *scene_entries(self.lessons.open_scene),
            ]
        )

    def follow(self) -> None:
        """From now on show every state, on a thread of the page's own."""
        self._updates = PageUpdates(self.show)
        self._unsubscribe = self._resources.controller.subscribe(self._updates.put)

    def show(self, state: RunState) -> None:
        """Bring the browser up to date, at once."""
        self.fill(state)
        self._client.flush()

    def fill(self, state: RunState) -> None:
        """Queue the messages that bring the browser up to date."""
        page_state, surface = self.page_state, self.layers.surface
        self._resources.follow(state)
        self._name_blocks(state.options.schedule.order)
        state = at_viewed_moment(state, page_state)
        if state.rival is not None and _refers_to(page_state.reference, state.run_id):
            page_state.reference = Reference(state.rival)
        self._pick_face(state)
        self.lessons.show(state, page_state)
        self.layers.show(state, page_state)
        self.panels.show(state, surface.legend, surface.is_painting)
        if state.problem and state.problems > self._problems:
            self.frame.toasts.show(state.problem)
        self._problems = state.problems
        vertices = surface.vertices_of(state, page_state.shape)
        self.camera.camera_view.show_overlay(state, vertices, page_state)

    def _pick_face(self, state: RunState) -> None:
        """Show the face with the largest energy around a vertex that was just selected, once energies are known.

        Not while vertices move: its cells are computed when they rest, and those on the page would be gone until then.
        """
        page_state, mesh = self.page_state, self._resources.scene.mesh
        if not page_state.picks_face or page_state.selected is None or state.is_moving:
            return
        ring = mesh.one_rings[page_state.selected]
        known = self._resources.residuals.of(state)
        if len(ring) and (found := known.up_to(state.moment)) is not None:
            losses = known.by_moment[found[0]].loss_by_face()[ring]
            page_state.face, page_state.picks_face = int(ring[losses.argmax()]), False

    def open_lesson(self, name: str) -> None:
        """Begin a lesson that fits the scene."""
        self.frame.toasts(self.lessons.open)(name)

    def close(self) -> None:
        """The browser has disconnected."""
        self._unsubscribe()
        if self._updates is not None:
            self._updates.close()
        self.lessons.close()
        self.layers.close()
        self.panels.close()
        self.frame.close()

    def _hotkeys(self) -> list[Hotkey]:
        run, panels, interaction = self.run_controls, self.panels, self.interaction
        actions = [
            Hotkey(action.label, run.poster(action.command), *(action.keys or [(None, None)])[0], action.keys[1:])
            for action in ACTIONS
        ]
        return [
            *actions,
            Hotkey(KEY_LABELS[";"], lambda: run.to_move_of_selected(-1), ";"),
            Hotkey(KEY_LABELS["'"], lambda: run.to_move_of_selected(1), "'"),
            Hotkey(KEY_LABELS["T"], panels.timeline.play_or_stop, "T"),
            Hotkey(KEY_LABELS["C"], panels.runs.mark_now, "C"),
            Hotkey(KEY_LABELS["K"], panels.bookmarks.keep_now, "K"),
            Hotkey(KEY_LABELS["Shift+I"], panels.step_into, "I", "shift"),
            Hotkey(KEY_LABELS["Shift+J"], lambda: panels.cells_controls.move_part(1), "J", "shift"),
            Hotkey(KEY_LABELS["Shift+K"], lambda: panels.cells_controls.move_part(-1), "K", "shift"),
            Hotkey(KEY_LABELS["Shift+P"], panels.presenter.switch, "P", "shift"),
            Hotkey(KEY_LABELS["X"], panels.surface_controls.before_or_now, "X"),
            Hotkey("Surface: before and now, with a divider", panels.surface_controls.toggle_divider),
            *(
                [
                    Hotkey(
                        f"Surface: {name} per pixel or per face",
                        partial(panels.surface_controls.toggle_per_pixel, surface),
                    )
                    for surface, name in (("residual", "residual"), ("flow", "image flow"))
                ]
                if panels.surface_controls.has_detail
                else []
            ),
            Hotkey(KEY_LABELS["-"], panels.surface_controls.toggle_view_dependent, "-"),
            Hotkey(KEY_LABELS["?"], lambda: self._keys_dialog.open(key_list(self._order)), "?", "shift"),
            Hotkey(KEY_LABELS["F"], interaction.toggle_lock, "F"),
            Hotkey(KEY_LABELS["Z"], interaction.reset, "Z"),
            Hotkey(KEY_LABELS["B"], run.toggle_breakpoint, "B"),
        ]

    def _name_blocks(self, order: str) -> None:
        """Name steps in the palette by what they step in the current order."""
        if order != self._order:
            self._order = order
            labels = {action.label: action.label_in(order) for action in ACTIONS}
            self.frame.rename_hotkeys(lambda label: labels.get(label, label))

    def _look_for_lesson(self, eye: str | int) -> None:
        """Move the camera to a viewpoint by its name, or into the camera with this index."""
        camera = self.camera
        if isinstance(eye, str):
            {AT_MESH: camera.show_mesh, AT_FRONT: camera.show_front, AT_CAMERAS: camera.show_mesh_and_cameras}[eye]()
        else:
            camera.enter(eye)

    def _camera_changed(self, view_id: int | None) -> None:
        self.page_state.entered = view_id
        self._resources.controller.republish()


def _refers_to(reference: Reference | None, run_id: int) -> bool:
    """Whether there is no reference, or it is the run itself, with which a comparison shows nothing."""
    return reference is None or reference.run_id == run_id
