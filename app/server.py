"""Opens the debugger in the browser."""

import contextlib
import io
import logging
import sys
import threading
import warnings
import webbrowser
from pathlib import Path

import viser

from app.background import Background
from app.compare import RunEnergies
from app.controller import Controller
from app.hardening import start_server
from app.history import EnergyHistory, PathHistory
from app.layers.cameras import Thumbnails
from app.page import Page, Shared
from app.photo_store import PhotoStore
from app.run_state import RunState
from app.stage import FIELD_OF_VIEW, Stage
from app.texturer import Texturer
from app.view import View
from fairing.session import Session

PANEL_WIDTH = 340
SWITCH_SECONDS = 0.001


class App:
    """A running debugger: one engine, any number of browsers."""

    def __init__(self, session: Session, host: str, port: int, save_to: Path | None, recorded_in: Path | None) -> None:
        # The engine computes in Python, too: others would wait 5 ms for every word they put in.
        sys.setswitchinterval(SWITCH_SECONDS)
        # A browser may go while it is being shown something; nothing is lost by that.
        warnings.filterwarnings("ignore", message="Queued a .* on a closed connection")
        scene = session.scene
        stage = Stage.of(scene)
        self._server = start_server(host, port)
        self.host, self.port = host, self._server.get_port()
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
        )
        self._pages: dict[int, Page] = {}
        self._pages_lock = threading.Lock()
        self._latest_view = View()
        self._set_the_stage(stage)
        self.controller.subscribe(self._show)
        self._server.on_client_connect(self._welcome)
        self._server.on_client_disconnect(self._farewell)

    @property
    def url(self) -> str:
        """Where the page is."""
        host = "127.0.0.1" if self.host in ("0.0.0.0", "::") else self.host
        return f"http://{host}:{self.port}"

    def stop(self) -> None:
        """Ends the engine, closes the record's file, lets the browsers go."""
        self.controller.close()
        self._shared.texturer.close()
        self._shared.background.close()
        self._shared.thumbnails.close()
        with self._pages_lock:
            for page in self._pages.values():
                page.close()
            self._pages.clear()
        with contextlib.redirect_stdout(io.StringIO()):
            self._server.stop()

    def _set_the_stage(self, stage: Stage) -> None:
        server = self._server
        server.gui.configure_theme(dark_mode=True, show_logo=False, show_share_button=False)
        server.gui.main_panel.dock_right()
        server.gui.main_panel.set_width(PANEL_WIDTH)
        server.scene.set_up_direction(tuple(stage.up))
        # The default picture of a room takes seconds to unpack, and the textures need no light.
        server.scene.configure_environment_map(None)
        server.scene.configure_default_lights(cast_shadow=False)
        server.scene.add_light_ambient("/light", intensity=0.25)
        server.scene.world_axes.visible = False
        server.initial_camera.position = tuple(stage.eye)
        server.initial_camera.look_at = tuple(stage.target)
        server.initial_camera.up = tuple(stage.up)
        server.initial_camera.fov = FIELD_OF_VIEW

    def _welcome(self, client: viser.ClientHandle) -> None:
        try:
            with self._pages_lock:
                view = self._latest_view.copy()
            # In one piece, or the browser lays itself out again for every few widgets that arrive.
            with client.atomic():
                page = Page(client, self._shared, view)
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
        if page is not None:
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
) -> App:
    """Open the debugger and return at once. See `serve`."""
    return App(session, host, port, save_to, recorded_in)


def serve(
    session: Session,
    *,
    host: str = "127.0.0.1",
    port: int = 8080,
    open_browser: bool = True,
    save_to: Path | None = None,
    recorded_in: Path | None = None,
) -> None:
    """Open the debugger, paused, and stay until Ctrl-C.

    Args:
        port: 0 for any free one.
        open_browser: also open the page in the user's browser.
        save_to: keep the record in this file.
        recorded_in: the file the record was read from; its bookmarks are beside it.

    Raises:
        InputError: the address cannot be used, `save_to` cannot be written, or the bookmarks cannot be read.
    """
    app = start(session, host=host, port=port, save_to=save_to, recorded_in=recorded_in)
    try:
        with contextlib.suppress(KeyboardInterrupt):
            print(f"EigenFairing is at {app.url} - Ctrl-C ends it.", flush=True)  # noqa: T201 - the one line a user needs
            if open_browser:
                webbrowser.open(app.url)
            # A Ctrl-C that arrives just before a wait begins does not end it, so none is long.
            never = threading.Event()
            while not never.wait(timeout=0.5):
                pass
    finally:
        app.stop()
