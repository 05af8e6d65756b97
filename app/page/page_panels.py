"""The panels of one page: built once, then brought up to date with every state, but not more often than is legible."""

import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import viser

from app.debugger.run_state import Activity, RunState
from app.files.run_files import REPORT
from app.page.lesson_dock import LessonDock
from app.page.page_frame import PageFrame
from app.page.plugins import offered_panels
from app.page.presenter import Presenter
from app.page.resources import SessionResources
from app.page.sharing import SHARE_KINDS, Sharing
from app.page.vertex_interaction import VertexInteraction
from app.page_state.association_source import AssociationSource
from app.page_state.cells_controls import CellsControls
from app.page_state.certainty_source import CertaintySource
from app.page_state.page_state import LARGE_MESH, PageState
from app.page_state.pull_source import PullSource
from app.page_state.run_controls import RunControls
from app.page_state.selection import Selection
from app.panels import Panel
from app.panels.bookmarks_panel import BookmarksPanel
from app.panels.box_panel import BoxPanel
from app.panels.breakpoints_panel import BreakpointsPanel
from app.panels.camera_box import CameraBox
from app.panels.cameras_panel import CamerasPanel
from app.panels.cell_lens import CellLens
from app.panels.cell_source import CellSource
from app.panels.cells_panel import CellsPanel
from app.panels.certainty_panel import CertaintyPanel
from app.panels.debug_bar import DebugBar
from app.panels.experiments_panel import ExperimentsPanel
from app.panels.iteration_page import IterationSource
from app.panels.layers_panel import LayersPanel
from app.panels.legend import LegendBox
from app.panels.lesson_panel import LESSON_STYLE
from app.panels.options_panel import OptionsPanel
from app.panels.photo_pages import PhotoPages
from app.panels.plot import Plot
from app.panels.point_photos import PointPhotos
from app.panels.profile_panel import ProfilePanel
from app.panels.pulls_panel import PullsPanel
from app.panels.result_card import ResultCard
from app.panels.runs_panel import RunsPanel
from app.panels.selection_panel import SelectionNote, SelectionPanel
from app.panels.status import Status
from app.panels.surface_panel import SurfaceControls, SurfacePanel
from app.panels.timeline import Timeline
from app.panels.variables import Variables
from app.panels.watch_panel import WatchPanel
from app.pictures.coloring import Legend
from app.viser_bridge.error_toasts import NothingToDo
from app.viser_bridge.html_events import whole_number
from app.viser_bridge.presenter_style import STYLE as PRESENTER_STYLE
from app.viser_bridge.presenter_style import PresenterStyle
from app.viser_bridge.tabs import show_tab

UPDATE_SECONDS = 0.25  # while the mesh moves, panels are updated this often (ledger: updates of panels)
CELLS_WIDTH = 374  # px: three cells of 110 px beside each other
MAIN_WIDTH = 340  # px, as viser has it


class PagePanels:
    """Attributes:
    surface_controls, cells_controls, timeline, runs, bookmarks, sharing, presenter: what hotkeys call, too.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        frame: PageFrame,
        resources: SessionResources,
        page_state: PageState,
        run_controls: RunControls,
        interaction: VertexInteraction,
        certainty: CertaintySource,
        pulls: PullSource,
        associations: AssociationSource,
        lessons: LessonDock,
    ) -> None:
        self._client, self._frame, self._resources, self._page_state = client, frame, resources, page_state
        self._run_controls, self._interaction, self._certainty = run_controls, interaction, certainty
        self._pulls = pulls
        self._republish: Callable[[], None] = resources.controller.republish
        self._updated, self._activity = 0.0, Activity.PAUSED
        self._timer: threading.Timer | None = None
        self._panels: list[Panel] = []
        self.surface_controls = SurfaceControls(frame.html_events, resources.scene, page_state, self._republish)
        self.sharing = Sharing(client, resources.controller, frame.toasts)
        self._add_bar()
        self._add_tabs()
        self._add_cells(lessons)
        timeline = self._add_timeline()
        gui, events = client.gui, frame.html_events
        style = PresenterStyle(gui, events, (self._cells, CELLS_WIDTH), (gui.main_panel, MAIN_WIDTH))
        self.presenter = Presenter(page_state, style, self._republish)
        self._legend = LegendBox(client, resources.scene.mesh, pulls, associations)
        self._panels.append(
            CameraBox(
                client.gui, frame.html_events, resources.scene, page_state, self.surface_controls, frame.camera.leave,
                self._republish,
            )
        )  # fmt: skip
        self._panels.append(self._profile)  # last: what the others show is computed before its many energies
        frame.finish(timeline, LESSON_STYLE + PRESENTER_STYLE)

    def show(self, state: RunState, legend: Legend | None, is_painting: bool) -> None:
        """Bring the panels up to date, now or when it is time again: while the mesh moves, they may lag behind it.

        Args:
            legend: of the surface colours; None if the surface is not coloured.
            is_painting: whether the surface waits for its texture.
        """
        self._legend.show(state, self._page_state, legend, is_painting)
        due = self._updated + UPDATE_SECONDS - time.monotonic()
        if state.is_moving and due > 0 and state.activity is self._activity:
            if self._timer is None:
                self._timer = threading.Timer(due, self._update_is_due)
                self._timer.daemon = True
                self._timer.start()
            return
        self._updated, self._activity = time.monotonic(), state.activity
        for panel in self._panels:
            panel.show(state, self._page_state)

    def close(self) -> None:
        """The browser has disconnected."""
        self.sharing.close()
        if self._timer is not None:
            self._timer.cancel()

    def _update_is_due(self) -> None:
        self._timer = None
        self._republish()

    def step_into(self) -> None:
        """Show the parts of the next step of the selected vertex.

        Raises:
            NothingToDo: no vertex is selected.
        """
        if self._page_state.selected is None:
            raise NothingToDo("no vertex is selected; click one first")
        self.cells_controls.step_into()
        show_tab(self._client, "Cells")

    def _add_bar(self) -> None:
        """What stays above the tabs."""
        gui, events, resources = self._client.gui, self._frame.html_events, self._resources
        run = self._run_controls
        self._panels += [
            DebugBar(gui, events, run, self.step_into, self._switch_layout),
            Status(
                gui, resources.energies, resources.residuals, events.number(run.to_beginning), events.number(run.jump),
                events.button(self.show_result),
            ),
            Plot(
                gui, resources.scene.mesh, resources.energies, resources.run_energies, resources.run_errors,
                resources.residuals, events, self._page_state, self._pulls, run.jump, self._republish,
            ),
        ]  # fmt: skip

    def _switch_layout(self) -> None:
        self.presenter.switch()

    def _add_tabs(self) -> None:
        gui, events, resources = self._client.gui, self._frame.html_events, self._resources
        scene, page_state, run, republish = resources.scene, self._page_state, self._run_controls, self._republish
        interaction = self._interaction
        tabs = gui.add_tab_group()
        with tabs.add_tab("Vertex"):
            self._panels += [
                SelectionPanel(
                    gui, events, len(scene.mesh.vertices) - 1, self._choose_vertices, interaction.toggle_lock,
                    interaction.reset,
                ),
                PullsPanel(gui, events, self._pulls, page_state, republish),
                SelectionNote(gui),
                CertaintyPanel(gui, scene.mesh, self._certainty),
            ]  # fmt: skip
            self._profile = ProfilePanel(gui, scene.mesh, resources.controller)
            self._panels += [
                Variables(gui, scene.mesh, events.number(run.to_change)),
                WatchPanel(gui, events, scene, page_state, self._pulls, run.jump, republish),
            ]
        with tabs.add_tab("Breakpoints"):
            self._panels.append(BreakpointsPanel(gui, events, resources.controller, page_state))
        with tabs.add_tab("Layers"):
            self._panels += [
                SurfacePanel(gui, len(scene.mesh.faces), self.surface_controls, events.guarded),
                LayersPanel(
                    gui, events, scene, page_state, self._frame.camera.switch_theme, self._switch_layout, republish
                ),
            ]
            if scene.triangulated:
                self._panels.append(BoxPanel(gui, events, scene, page_state, republish))
        with tabs.add_tab("Options"):
            self._panels.append(OptionsPanel(gui, events, resources.controller))
        self._panels += offered_panels(gui, tabs, resources.controller, self._frame.toasts)

    def _add_cells(self, lessons: LessonDock) -> None:
        """The docked panel of the cells with the lessons, and the lens that enlarges their images."""
        gui, events, resources = self._client.gui, self._frame.html_events, self._resources
        scene, controller, background = resources.scene, resources.controller, resources.background
        source = CellSource(controller, scene.mesh)
        self.cells_controls = controls = CellsControls(events, self._page_state, scene, self._republish)
        choose_face, enter = events.number(self._choose_face), events.number(self._frame.camera.enter)
        pages = PhotoPages(controller, scene, resources.photos, controls, enter)
        cells = gui.add_panel()
        with cells.add_tab("Cells", viser.Icon.TRIANGLE):
            self._panels.append(
                CellsPanel(
                    gui,
                    scene,
                    source,
                    IterationSource(controller),
                    pages,
                    PointPhotos(scene, resources.photos, enter),
                    background,
                    controls,
                    self._result_card(lessons),
                    choose_face,
                    enter,
                    events.guarded,
                )
            )
        with cells.add_tab("Experiments", viser.Icon.CHART_DOTS):
            self._panels.append(
                ExperimentsPanel(self._client, events, resources.experiments, controller, self._page_state)
            )
        if resources.refinement is not None:
            with cells.add_tab("Cameras", viser.Icon.CAMERA):
                self._panels.append(
                    CamerasPanel(gui, events, scene, resources.refinement, self._page_state, enter, self._republish)
                )
        self._cells = cells
        cells.dock_left()
        cells.set_width(CELLS_WIDTH)
        self._panels += lessons.build(cells)
        self._panels.append(CellLens(gui, scene, source, pages, background, controls, enter, self._frame.view_width))

    def _result_card(self, lessons: LessonDock) -> ResultCard:
        resources, controller = self._resources, self._resources.controller

        def report_of(run_id: int) -> Path | None:
            record = controller.file_of(run_id)
            return None if record is None else record.with_name(REPORT)

        return ResultCard(
            resources.scene,
            self._frame.html_events,
            resources.residuals,
            resources.background,
            self.sharing,
            {name: kind.title for name, kind in SHARE_KINDS.items()},
            self._fly_to,
            lessons.open,
            report_of,
            self.surface_controls.toggle_divider,
        )

    def _fly_to(self, vertex: int) -> None:
        self._interaction.select(vertex)
        vertices = self._resources.stage.page_from_world(self._resources.controller.state.vertices)
        self._frame.camera.fly_to(vertex, vertices.astype(np.float64))

    def show_result(self) -> None:
        """Show the result of a finished run, which is beside no selected vertex."""
        if not self._resources.controller.state.finished:
            raise NothingToDo("the run has not finished yet; press Run")
        self._interaction.set_selection(Selection())
        show_tab(self._client, "Cells")

    def _add_timeline(self) -> viser.PanelHandle:
        gui, events, resources = self._client.gui, self._frame.html_events, self._resources
        controller, page_state = resources.controller, self._page_state
        panel = gui.add_panel()
        with panel.add_tab("Timeline", viser.Icon.CLOCK):
            self.timeline = Timeline(gui, events, controller, page_state, resources.energies, self._run_controls)
        with panel.add_tab("Runs", viser.Icon.GIT_FORK):
            self.runs = RunsPanel(gui, events, controller, page_state, resources.residuals)
        with panel.add_tab("Bookmarks", viser.Icon.BOOKMARK):
            self.bookmarks = BookmarksPanel(gui, events, controller, page_state)
        self._panels += [self.timeline, self.runs, self.bookmarks]
        return panel

    def _choose_vertices(self, selection: Selection) -> None:
        """Select vertices by number. On a large mesh the camera flies to the first of them."""
        self._interaction.set_selection(selection)
        if selection.current is not None and len(self._resources.scene.mesh.vertices) > LARGE_MESH:
            vertices = self._resources.stage.page_from_world(self._resources.controller.state.vertices)
            self._frame.camera.fly_to(selection.current, vertices.astype(np.float64))

    def _choose_face(self, face: object) -> None:
        faces = self._resources.scene.mesh.faces
        self._page_state.face, self._page_state.picks_face = whole_number(face, 0, len(faces) - 1, "face"), False
        self._republish()
