"""The debugger's server: one session, and one page for every browser that connects."""

import logging
import sys
import threading
from pathlib import Path

import viser

from app.debugger.actions import ACTIONS
from app.debugger.controller import Controller
from app.debugger.engine_compilation import EngineCompilation
from app.lessons.scenes import LESSON_SCENES, load_lesson_scene
from app.page.free_memory import FreeMemory
from app.page.page import Page
from app.page.resources import SessionResources
from app.page_state.page_state import PageState
from app.stage import FIELD_OF_VIEW
from app.viser_bridge.server import ViewerServer, start_viewer
from app.viser_bridge.tabs import reload_page
from fairing.errors import InputError
from fairing.run.session import Session

SWITCH_SECONDS = 0.001
OTHERS_RELOAD = 4.0  # s


class App:
    """A running debugger: one engine, any number of browsers.

    Attributes:
        resources: of the session that is shown.
        pages: by the id of their browser.
    """

    def __init__(
        self,
        server: ViewerServer,
        session: Session,
        save_to: Path | None = None,
        recorded_in: Path | None = None,
        lesson: str | None = None,
        compilation: EngineCompilation | None = None,
    ) -> None:
        self._compilation = compilation
        # The engine computes in Python, too: at the default of 5 ms every callback would wait that long for its turn.
        sys.setswitchinterval(SWITCH_SECONDS)
        self._server, self.port = server, server.get_port()
        self.pages: dict[int, Page] = {}
        self._lock = threading.Lock()  # of the attributes; held for moments only, never while a page or scene is made
        self._loading = threading.Lock()  # while another scene is loaded
        self._free_memory = FreeMemory()
        self._lesson_due = lesson or None
        self._latest = PageState.of_mesh(len(session.scene.mesh.vertices))
        self.resources = SessionResources.open(session, save_to, recorded_in, self._change_scene, compilation)
        self._show_session(self.resources)
        pressed = server.opening.close()
        for action in ACTIONS:
            if action.label in pressed:
                self.resources.controller.post(action.command)
        self._server.on_client_connect(self._connected)
        self._server.on_client_disconnect(self._disconnected)

    @property
    def controller(self) -> Controller:
        """The controller of the session that is shown."""
        return self.resources.controller

    @property
    def url(self) -> str:
        """The page's address."""
        return self._server.url

    def stop(self) -> None:
        """End the engine, close the trace's file and disconnect all browsers."""
        if self._compilation is not None:
            self._compilation.close()
        self._close(self.resources, self._take_pages())
        self._free_memory.close()
        self._server.close()

    def _take_pages(self) -> list[Page]:
        with self._lock:
            pages = list(self.pages.values())
            self.pages.clear()
        return pages

    @staticmethod
    def _close(resources: SessionResources, pages: list[Page]) -> None:
        resources.close()
        for page in pages:
            page.close()

    def _change_scene(self, client: viser.ClientHandle, scene: str, lesson: str) -> None:
        """Load another scene of the lessons, show it from now on, and open a lesson in the browser that requested it.

        All runs on the present scene are closed. All browsers reload the page; those that did not ask do so a little
        later, so that the lesson opens in the one that did.

        Raises:
            InputError: another scene is being loaded.
        """
        if not self._loading.acquire(blocking=False):
            raise InputError("another scene is being opened; wait until it is there")
        try:
            if client.client_id not in self.pages:  # a second request from a page of the scene before
                return
            resources = self._load(client, scene)
            with self._lock:
                old, self.resources = self.resources, resources
                self._latest = PageState.of_mesh(len(resources.scene.mesh.vertices))
                self._lesson_due = lesson or None
            self._close(old, self._take_pages())
            self._show_session(resources)
        finally:
            self._loading.release()
        for other in self._server.get_clients().values():
            reload_page(other, 0 if other is client else OTHERS_RELOAD)

    def _load(self, client: viser.ClientHandle, scene: str) -> SessionResources:
        toast = client.add_notification("Opening a scene", LESSON_SCENES[scene].title, loading=True)

        def show_progress(fraction: float, line: str) -> None:
            toast.body = f"{line} ({100 * fraction:.0f} %)"

        try:
            session = Session(load_lesson_scene(scene, show_progress))
        finally:
            toast.remove()
        return SessionResources.open(session, None, None, self._change_scene, self._compilation)

    def _show_session(self, resources: SessionResources) -> None:
        server, stage = self._server, resources.stage
        server.scene.set_up_direction(tuple(stage.up))
        server.initial_camera.position = tuple(stage.eye)
        server.initial_camera.look_at = tuple(stage.target)
        server.initial_camera.up = tuple(stage.up)
        server.initial_camera.fov = FIELD_OF_VIEW
        resources.controller.subscribe(resources.forget_deleted_runs)
        resources.controller.subscribe(self._free_memory.follow)

    def _connected(self, client: viser.ClientHandle) -> None:
        with self._lock:
            resources, page_state = self.resources, self._latest.copy()
            lesson, self._lesson_due = self._lesson_due, None
        try:
            # In one piece, or the browser lays out the page again for every few widgets that arrive.
            with client.atomic():
                page = Page(client, resources.for_page(), page_state)
                if lesson is not None:
                    page.open_lesson(lesson)
                page.fill(resources.controller.state)
        except Exception:
            logging.getLogger(__name__).exception("a page could not be built")
            client.add_notification("The page could not be built", "See the terminal for the reason.", color="red")
            return
        with self._lock:
            is_current = resources is self.resources
            if is_current:
                self.pages[client.client_id] = page
                page.follow()
        if not is_current:  # the scene was changed meanwhile
            page.close()
            reload_page(client, 0)

    def _disconnected(self, client: viser.ClientHandle) -> None:
        with self._lock:
            page = self.pages.pop(client.client_id, None)
            if page is not None:
                self._latest = page.page_state
        if page is not None:
            page.close()
            self._free_memory.page_has_gone()


def start(
    session: Session,
    *,
    host: str = "127.0.0.1",
    port: int = 8080,
    save_to: Path | None = None,
    recorded_in: Path | None = None,
    lesson: str | None = None,
    token: str | None = None,
) -> App:
    """Open the debugger and return at once; see `app.cli.serve.serve`.

    Raises:
        InputError: the address cannot be used, `save_to` cannot be written, or the bookmarks cannot be read.
    """
    return App(start_viewer(host, port, token), session, save_to, recorded_in, lesson)
