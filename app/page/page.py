"""One browser's page: its panels, its layers, its selection. All pages show the same run."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import viser

from app.background_worker import Background
from app.debugger.actions import ACTIONS, key_list
from app.debugger.compare import Reference, RunEnergies
from app.debugger.controller import Controller
from app.debugger.history import EnergyHistory, PathHistory
from app.debugger.run_state import Activity, RunState
from app.experiments.experiment_runner import ExperimentRunner
from app.html import STYLE, text
from app.layers import Layer
from app.layers.cameras import CamerasLayer, Thumbnails
from app.layers.certainty import CertaintyLayer
from app.layers.drag_handle import DragHandleLayer
from app.layers.paths import PathsLayer
from app.layers.points import PointsLayer
from app.layers.reference_mesh import ReferenceMeshLayer
from app.layers.step_arrow import StepArrowLayer
from app.layers.surface import SurfaceLayer
from app.layers.vertices import VerticesLayer
from app.layers.wireframe import WireframeLayer
from app.lessons.page_settings import AT_CAMERAS, AT_FRONT, AT_MESH
from app.page.camera_view import CameraView
from app.page.lesson_dock import LessonRoom
from app.page.run_controls import RunControls
from app.page.vertex_interaction import VertexInteraction
from app.page_state.cells_controls import CellsControls
from app.page_state.certainty_source import CertaintySource
from app.page_state.page_state import MAX_MAGNIFICATION, PageState
from app.page_state.past_moment import at_viewed_moment
from app.panels import Panel
from app.panels.bookmarks_panel import BookmarkButtons, BookmarksPanel
from app.panels.breakpoints_panel import BreakpointButtons, BreakpointsPanel
from app.panels.camera_box import CameraBox, CameraButtons
from app.panels.cell_lens import CellLens
from app.panels.cell_source import CellSource
from app.panels.cells_panel import CellsPanel
from app.panels.certainty_panel import CertaintyPanel
from app.panels.debug_bar import DebugBar
from app.panels.experiments_panel import ExperimentButtons, ExperimentsPanel
from app.panels.layers_panel import LayersPanel, available_layers
from app.panels.legend import LegendBox
from app.panels.lesson_panel import LESSON_STYLE
from app.panels.options_panel import OptionButtons, OptionsPanel
from app.panels.photo_pages import PhotoPages
from app.panels.plot import Plot, PlotControls
from app.panels.runs_panel import RunButtons, RunsPanel
from app.panels.selection_panel import SelectionPanel
from app.panels.status import Status
from app.panels.surface_panel import SurfaceButtons, SurfacePanel
from app.panels.timeline import Timeline, TimelineButtons
from app.panels.variables import Variables
from app.panels.watch_panel import WatchControls, WatchPanel
from app.pictures.photo_store import PhotoStore
from app.pictures.texturer import Texturer
from app.stage import FIELD_OF_VIEW, Stage
from app.viser_bridge.error_toasts import Guard
from app.viser_bridge.html_events import Bridge, whole_number
from app.viser_bridge.html_panel import HtmlPanel
from app.viser_bridge.in_place import change_in_place
from app.viser_bridge.keyboard_focus import release_focus_after_use
from app.viser_bridge.style_sheet import lay_style_sheet
from app.viser_bridge.theme import Theme
from app.viser_bridge.timeline_placement import TimelinePlace
from fairing.scene import Scene

PANELS_EVERY = 0.25  # s: while it runs, numbers change slower than the eye follows the mesh
# Panels behind other tabs are sent, too: viser does not tell which tab is in front, and on the cube they are 5 of the 39
# kB of HTML a second (before compression) and cost the browser nothing, because it does not lay them out.
CELLS_WIDTH = 362


@dataclass(frozen=True, eq=False)
class Shared:
    """What all pages have in common.

    Attributes:
        change_scene: shows a scene of the lessons instead, and opens a lesson there in the browser given.
    """

    scene: Scene
    stage: Stage
    controller: Controller
    energies: EnergyHistory
    run_energies: RunEnergies
    paths: PathHistory
    thumbnails: Thumbnails
    texturer: Texturer
    background: Background
    photos: PhotoStore
    experiments: ExperimentRunner
    change_scene: Callable[[viser.ClientHandle, str, str], None]


class Page:
    """Builds everything on connection; afterwards only `show` and the user's clicks change it."""

    def __init__(self, client: viser.ClientHandle, shared: Shared, view: PageState) -> None:
        self.view = view
        self._client, self._shared = client, shared
        self._guard = Guard(client)
        self._run = RunControls(shared.controller, view)
        self._problems = shared.controller.state.problems
        self._panels_shown, self._panels_activity = 0.0, Activity.PAUSED
        self._panels_timer: threading.Timer | None = None
        self._hands = VertexInteraction(client, shared.stage, shared.scene.mesh, shared.controller, view, self._guard)
        self._theme = Theme(client)
        self._look_through = CameraView(client, shared.stage, shared.scene, self._theme, shared.controller.republish)
        client.gui.set_panel_label(f"EigenFairing · {shared.scene.name}")
        certainty = CertaintySource(shared.controller)
        self._panels: list[Panel] = self._build_panels(certainty)
        self._surface = SurfaceLayer(client, shared.stage, shared.scene, shared.texturer, shared.controller)
        stage, scene, hands = shared.stage, shared.scene, self._hands
        self._layers: list[Layer] = [
            self._surface,
            WireframeLayer(client, stage, scene),
            VerticesLayer(client, stage, scene.mesh, self._guard(hands.click), hands.watch),
            DragHandleLayer(client, stage, scene.mesh, self._guard(hands.click), hands.watch, hands.grab, hands.drop),
            ReferenceMeshLayer(client, stage, scene.mesh),
            PathsLayer(client, stage, shared.paths),
            StepArrowLayer(client, stage, scene),
            CertaintyLayer(client, stage, scene.mesh, certainty),
            PointsLayer(client, stage, scene.sparse_points),
            CamerasLayer(client, stage, scene, shared.thumbnails, self._guard(self._enter), hands.watch),
        ]
        self._stand_at(shared.stage.eye)  # a browser may have come before there was a scene to look at
        self._add_commands()
        release_focus_after_use(client)
        change_in_place(client)
        client.camera.on_update(self._guard.without_event(self._follow_camera))

    def show(self, state: RunState) -> None:
        """Bring the browser up to date, at once."""
        self.fill(state)
        self._client.flush()

    def fill(self, state: RunState) -> None:
        """Bring the browser up to date."""
        state = at_viewed_moment(state, self.view)
        if state.rival is not None and self.view.reference is None:
            self.view.reference = Reference(state.rival)
        self._lessons.show(state, self.view)
        for layer in self._layers:
            layer.show(state, self.view)
        self._fill_panels(state)
        if state.problem and state.problems > self._problems:
            self._guard.notify(state.problem)
        self._problems = state.problems
        self._legend.show(self._surface.legend)
        self._look_through.lay_over(state, self._surface.vertices_of(state, self.view.shape), self.view)

    def _fill_panels(self, state: RunState) -> None:
        """Now, or when it is time again: a step may take long, and then they would stay behind until its end."""
        due = self._panels_shown + PANELS_EVERY - time.monotonic()
        if state.is_moving and due > 0 and state.activity is self._panels_activity:
            if self._panels_timer is None:
                self._panels_timer = threading.Timer(due, self._panels_are_due)
                self._panels_timer.daemon = True
                self._panels_timer.start()
            return
        self._panels_shown, self._panels_activity = time.monotonic(), state.activity
        for panel in self._panels:
            panel.show(state, self.view)

    def _panels_are_due(self) -> None:
        self._panels_timer = None
        self._shared.controller.republish()

    def open_lesson(self, name: str) -> None:
        """Begin a lesson that fits the scene."""
        self._guard(self._lessons.open)(name)

    def close(self) -> None:
        """The browser is gone."""
        self._surface.close()
        self._look_through.close()

    # ------------------------------------------------------------------ building

    def _build_panels(self, certainty: CertaintySource) -> list[Panel]:
        gui, shared = self._client.gui, self._shared
        bridge = Bridge(gui, self._guard)
        press = {action.name: bridge.button(self._run.poster(action.command)) for action in ACTIONS}
        switches = {
            name: bridge.button(lambda name=name: self._toggle(name)) for name in available_layers(shared.scene)
        }
        camera = CameraButtons(bridge, self.view, self._leave, shared.controller.republish)
        panels: list[Panel] = [
            DebugBar(gui, press),
            Status(gui, shared.energies, bridge.number(self._run.to_beginning)),
            Plot(
                gui,
                shared.scene.mesh,
                shared.energies,
                shared.run_energies,
                PlotControls(bridge, self.view, self._run.jump, shared.controller.republish),
            ),
        ]
        choose_face, enter = bridge.number(self._choose_face), bridge.number(self._enter)
        jump = bridge.number(self._run.jump)
        around = {
            "before": bridge.button(lambda: self._run.to_move_of_selected(-1)),
            "after": bridge.button(lambda: self._run.to_move_of_selected(1)),
        }
        hand_buttons = {
            "lock": bridge.button(self._hands.toggle_lock),
            "reset": bridge.button(self._hands.reset),
        }
        breakpoint_buttons = BreakpointButtons(shared.controller, self.view, bridge)
        self._surface_buttons = SurfaceButtons(shared.scene, self.view, bridge.button, shared.controller.republish)
        theme = bridge.button(self._switch_theme)
        option_buttons = OptionButtons(bridge.button)
        self._play = TimelineButtons(shared.controller, self.view, bridge)
        self._runs = RunButtons(shared.controller, self.view, bridge)
        self._bookmarks = BookmarkButtons(shared.controller, self.view, bridge)
        self._lessons = LessonRoom(
            self._client, shared.controller, bridge, self._guard, self._lead_eye, shared.change_scene
        )
        scene, source = shared.scene, CellSource(shared.controller, shared.scene.mesh)
        controls = CellsControls(bridge, self.view, scene, shared.controller.republish)
        to_change = bridge.number(self._run.to_change)
        watch = WatchControls(bridge, self.view, self._run.jump, shared.controller.republish)
        pages = PhotoPages(shared.controller, scene, shared.photos, controls, enter)
        experiments = ExperimentButtons(self._client, shared.experiments, shared.controller, self.view, bridge)
        tabs = gui.add_tab_group()
        with tabs.add_tab("Vertex"):
            last = len(shared.scene.mesh.vertices) - 1
            panels.append(SelectionPanel(gui, bridge, last, self._hands.choose, hand_buttons))
            panels.append(CertaintyPanel(gui, certainty))
            panels.append(Variables(gui, shared.scene.mesh, to_change))
            panels.append(WatchPanel(gui, scene, self.view, watch, bridge, shared.controller.republish))
        with tabs.add_tab("Breakpoints"):
            panels.append(BreakpointsPanel(gui, shared.controller, bridge, breakpoint_buttons))
        with tabs.add_tab("Layers"):
            panels.append(SurfacePanel(gui, len(scene.mesh.faces), self._surface_buttons, self._guard))
            panels.append(LayersPanel(gui, switches, theme))
            self._magnification = gui.add_slider(
                "Magnify paths",
                min=1,
                max=MAX_MAGNIFICATION,
                step=1,
                initial_value=self.view.magnification,
                hint="Displacements are drawn this many times longer, about where the vertices are now.",
            )
            self._magnification.on_update(self._guard.without_event(self._magnify))
        with tabs.add_tab("Options"):
            panels.append(OptionsPanel(gui, shared.controller, self._guard, option_buttons))
        cells = gui.add_panel()
        with cells.add_tab("Cells", viser.Icon.TRIANGLE):
            panels.append(
                CellsPanel(gui, scene, source, pages, shared.background, controls, choose_face, enter, self._guard)
            )
        with cells.add_tab("Experiments", viser.Icon.CHART_DOTS):
            panels.append(ExperimentsPanel(gui, shared.experiments, experiments))
        cells.dock_left()
        cells.set_width(CELLS_WIDTH)
        panels += self._lessons.build(cells)
        panels.append(CellLens(gui, scene, source, pages, shared.background, controls, enter))
        timeline = gui.add_panel()
        with timeline.add_tab("Timeline", viser.Icon.CLOCK):
            panels.append(Timeline(gui, shared.energies, self._guard(self._run.jump), jump, around, self._play))
        with timeline.add_tab("Runs", viser.Icon.GIT_FORK):
            panels.append(RunsPanel(gui, shared.scene, shared.run_energies, self._runs))
        with timeline.add_tab("Bookmarks", viser.Icon.BOOKMARK):
            panels.append(BookmarksPanel(gui, bridge, self._bookmarks))
        TimelinePlace(gui, timeline, bridge)
        self._legend = LegendBox(gui)
        panels.append(
            CameraBox(gui, scene, self.view, camera, self._surface_buttons, self._guard, shared.controller.republish)
        )
        lay_style_sheet(self._client, STYLE + LESSON_STYLE + bridge.style)
        return panels

    def _add_commands(self) -> None:
        for action in ACTIONS:
            for n, (key, modifier) in enumerate(action.keys):
                label = action.label if n == 0 else f"{action.label} ({key})"
                self._command(label, self._run.poster(action.command), key, modifier)
        for view_id, view in enumerate(self._shared.scene.views[:9]):
            self._command(f"Look through camera {view.name}", lambda v=view_id: self._enter(v), str(view_id + 1))
        self._command("Leave the camera", self._leave, "0")
        self._command("Previous move of the selected vertex", lambda: self._run.to_move_of_selected(-1), ";")
        self._command("Next move of the selected vertex", lambda: self._run.to_move_of_selected(1), "'")
        self._command("Show the mesh", lambda: self._look_from(self._shared.stage.eye), "M")
        self._command("Show mesh and cameras", lambda: self._look_from(self._shared.stage.overview()), "V")
        self._command("Play the record, or stop", self._play.play_or_stop, "T")
        self._command("Compare with this moment", self._runs.mark_now, "C")
        self._command("Bookmark this moment", self._bookmarks.keep_now, "K")
        self._command("Before or now", self._surface_buttons.before_or_now, "X")
        self._command("Texture static or by the eye", self._surface_buttons.static_or_by_eye, "-")
        self._command("Dark or light", self._switch_theme, "Y")
        self._command("Keys", self._help, "?", "shift")
        self._command("Lock or unlock the selected vertices", self._hands.toggle_lock, "F")
        self._command("Put the selected vertices back to their start", self._hands.reset, "Z")
        self._command("Breakpoint on the selected vertex", self._run.toggle_breakpoint, "B")
        for label, call, lesson_key in self._lessons.commands():
            self._command(label, call, lesson_key)

    def _command(self, label: str, call: Callable[[], None], key: str | None, modifier: str | None = None) -> None:
        guarded = self._guard.without_event(call)
        # viser accepts function keys although its type does not name them.
        hotkey: Any = key
        keys: Any = modifier
        command = self._client.gui.add_command(label, hotkey=hotkey, modifier=keys)
        command.on_trigger(guarded)

    # ------------------------------------------------------------------ what the user does

    def _choose_face(self, face: object) -> None:
        self.view.face = whole_number(face, 0, len(self._shared.scene.mesh.faces) - 1, "face")
        self._shared.controller.republish()

    def _look_from(self, eye: np.ndarray) -> None:
        self._leave()
        self._stand_at(eye)

    def _stand_at(self, eye: np.ndarray) -> None:
        with self._client.atomic():
            self._client.camera.up_direction = self._shared.stage.up
            self._client.camera.position = eye
            self._client.camera.look_at = self._shared.stage.target
            self._client.camera.fov = FIELD_OF_VIEW

    def _lead_eye(self, eye: str | int) -> None:
        """For lessons."""
        stage = self._shared.stage
        if isinstance(eye, str):
            self._look_from({AT_MESH: stage.eye, AT_FRONT: stage.frontal(), AT_CAMERAS: stage.overview()}[eye])
        else:
            self._enter(eye)

    def _help(self) -> None:
        rows = "".join(f"<tr><th>{text(keys)}</th><td>{text(meaning)}</td></tr>" for keys, meaning in key_list())
        with self._client.gui.add_modal("Keys") as modal:
            HtmlPanel(self._client.gui, f"<table class='words'>{rows}</table>")
            close = self._client.gui.add_button("Close")
        close.on_click(lambda _: modal.close())

    def _toggle(self, layer: str) -> None:
        self.view.shown[layer] = not self.view.shown[layer]
        self._shared.controller.republish()

    def _switch_theme(self) -> None:
        self._theme.switch()
        self._look_through.renew()

    def _magnify(self) -> None:
        self.view.magnification = whole_number(self._magnification.value, 1, MAX_MAGNIFICATION, "magnification")
        self._shared.controller.republish()

    def _enter(self, view_id: object) -> None:
        found = whole_number(view_id, 0, len(self._shared.scene.views) - 1, "camera")
        self._look_through.enter(found)
        self._announce_camera(found)

    def _leave(self) -> None:
        if self._look_through.inside is not None:
            self._look_through.leave()
            self._announce_camera(None)

    def _follow_camera(self) -> None:
        if self._look_through.follow():
            self._look_through.stay()
            self._announce_camera(None)

    def _announce_camera(self, view_id: int | None) -> None:
        self.view.entered = view_id
        self._shared.controller.republish()
