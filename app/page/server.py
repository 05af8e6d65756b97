"""Opens the debugger in the browser."""

import logging
import sys
import threading
import warnings
from pathlib import Path

import viser

from app.background_worker import Background
from app.debugger.compare import RunEnergies
from app.debugger.controller import Controller
from app.debugger.history import EnergyHistory, PathHistory
from app.debugger.run_state import RunState
from app.experiments.experiment_runner import ExperimentRunner
from app.layers.cameras import Thumbnails
from app.lessons.scenes import LESSON_SCENES, load_lesson_scene
from app.page.page import Page, Shared
from app.page_state.page_state import PageState
from app.pictures.photo_store import PhotoStore
from app.pictures.texturer import Texturer
from app.stage import FIELD_OF_VIEW, Stage
from app.viser_bridge.tabs import reload_page
from app.viser_bridge.viewer import address_of, start_viewer, stop_viewer
from fairing.run.session import Session

SWITCH_SECONDS = 0.001
OTHERS_RELOAD = 4.0  # s


class App:
    """A running debugger: one engine, any number of browsers."""

    def __init__(
        self,
        server: viser.ViserServer,
        session: Session,
        save_to: Path | None = None,
        recorded_in: Path | None = None,
        lesson: str | None = None,
    ) -> None:
        # The engine computes in Python, too: others would wait 5 ms for every word they put in.
        sys.setswitchinterval(SWITCH_SECONDS)
        # A browser may go while it is being shown something; nothing is lost by that.
        warnings.filterwarnings("ignore", message="Queued a .* on a closed connection")
        self._server, self.port = server, server.get_port()
        self._pages: dict[int, Page] = {}
        self._pages_lock = threading.Lock()
        self._changing = threading.Lock()
        self._lesson_due = lesson
        self._enter(session, save_to, recorded_in)
        self._server.on_client_connect(self._welcome)
        self._server.on_client_disconnect(self._farewell)

    def _enter(self, session: Session, save_to: Path | None = None, recorded_in: Path | None = None) -> None:
        """Begin to show a session."""
        scene = session.scene
        stage = Stage.of(scene)
        self.controller = Controller(session, save_to, recorded_in)
        self._shared = Shared(
            scene,
            stage,
            self.controller,
            EnergyHistory(len(scene.mesh.faces)),
            RunEnergies(len(scene.mesh.faces)),
            PathHistory(len(scene.mesh.vertices)),
            Thumbnails(scene),
            Texturer(scene, stage, self.controller.republish),
            Background(self.controller.republish),
            PhotoStore(scene),
            ExperimentRunner(scene, scene.name, self.controller.republish),
            self._change_scene,
        )
        self._latest_view = PageState()
        self._set_the_stage(stage)
        self.controller.subscribe(self._show)

    @property
    def url(self) -> str:
        """Where the page is."""
        return address_of(self._server)

    def stop(self) -> None:
        """Ends the engine, closes the record's file, lets the browsers go."""
        self._leave()
        stop_viewer(self._server)

    def _leave(self) -> None:
        self.controller.close()
        self._shared.texturer.close()
        self._shared.background.close()
        self._shared.thumbnails.close()
        self._shared.experiments.close()
        with self._pages_lock:
            for page in self._pages.values():
                page.close()
            self._pages.clear()

    def _change_scene(self, client: viser.ClientHandle, scene: str, lesson: str) -> None:
        """Show a scene of the lessons from now on, and open a lesson in the browser that asked. Takes its time.

        All runs on the present scene are left. Browsers load the page anew, which leaves nothing of the old scene; those
        that did not ask do so a little later, so that the lesson opens in the one that did.
        """
        with self._changing:
            if client.client_id not in self._pages:  # asked twice: this page is of the scene that was left
                return
            note = client.add_notification("Opening a scene", LESSON_SCENES[scene].title, loading=True)

            def tell(_: float, line: str) -> None:
                note.body = line

            try:
                session = Session(load_lesson_scene(scene, tell))
            finally:
                note.remove()
            self._leave()
            self._lesson_due = lesson
            self._enter(session)
        for other in self._server.get_clients().values():
            reload_page(other, 0 if other is client else OTHERS_RELOAD)

    def _set_the_stage(self, stage: Stage) -> None:
        server = self._server
        server.scene.set_up_direction(tuple(stage.up))
        server.initial_camera.position = tuple(stage.eye)
        server.initial_camera.look_at = tuple(stage.target)
        server.initial_camera.up = tuple(stage.up)
        server.initial_camera.fov = FIELD_OF_VIEW

    def _welcome(self, client: viser.ClientHandle) -> None:
        try:
            # In one piece, or the browser lays itself out again for every few widgets that arrive.
            with self._changing, client.atomic():
                page = Page(client, self._shared, self._latest_view.copy())
                lesson, self._lesson_due = self._lesson_due, None
                if lesson is not None:
                    page.open_lesson(lesson)
                page.fill(self.controller.state)
        except Exception:
            logging.getLogger(__name__).exception("a page could not be built")
            client.add_notification("The page could not be built", "See the terminal for the reason.", color="red")
            return
        with self._pages_lock:
            self._pages[client.client_id] = page
        self.controller.republish()

    def _farewell(self, client: viser.ClientHandle) -> None:
        with self._pages_lock:
            page = self._pages.pop(client.client_id, None)
        if page is not None:  # it is not of a scene that was left
            self._latest_view = page.view
            page.close()

    def _show(self, state: RunState) -> None:
        self._shared.energies.update(state)
        self._shared.paths.update(state)
        with self._pages_lock:
            pages = list(self._pages.values())
        for page in pages:
            try:
                page.show(state)
            except Exception:
                logging.getLogger(__name__).exception("a page could not be brought up to date")


def start(
    session: Session,
    *,
    host: str = "127.0.0.1",
    port: int = 8080,
    save_to: Path | None = None,
    recorded_in: Path | None = None,
    lesson: str | None = None,
) -> App:
    """Open the debugger and return at once; see `app.cli.serve.serve`.

    Raises:
        InputError: the address cannot be used, `save_to` cannot be written, or the bookmarks cannot be read.
    """
    return App(start_viewer(host, port), session, save_to, recorded_in, lesson)
