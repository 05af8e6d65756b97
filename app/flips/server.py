"""The server of a flip record: one page for every browser that connects."""

import logging
import threading

import viser

from app.background_worker import BackgroundWorker
from app.flips.page import FlipPage
from app.flips.story import Story
from app.layers.cameras import Thumbnails
from app.stage import FIELD_OF_VIEW, Stage
from app.viser_bridge.server import ViewerServer
from fairing.scene import Scene
from fairing.triangulation import FlipTrace


class FlipApp:
    """Shows a flip record to any number of browsers.

    Args:
        scene: the photos, with the mesh before the first flip.
    """

    def __init__(self, server: ViewerServer, scene: Scene, trace: FlipTrace) -> None:
        self._server, self._scene = server, scene
        self.story = Story(trace)
        self.stage = Stage.of(scene)
        self._thumbnails, self._painter = Thumbnails(scene), BackgroundWorker()
        self.pages: dict[int, FlipPage] = {}
        self._lock = threading.Lock()
        server.scene.set_up_direction(tuple(self.stage.up))
        camera = server.initial_camera
        camera.position, camera.look_at = tuple(self.stage.eye), tuple(self.stage.target)
        camera.up, camera.fov = tuple(self.stage.up), FIELD_OF_VIEW
        server.opening.close()
        server.on_client_connect(self._connected)
        server.on_client_disconnect(self._disconnected)

    @property
    def url(self) -> str:
        """The page's address."""
        return self._server.url

    def stop(self) -> None:
        """End the workers and disconnect all browsers."""
        with self._lock:
            pages = list(self.pages.values())
            self.pages.clear()
        for page in pages:
            page.close()
        self._painter.close()
        self._thumbnails.close()
        self._server.close()

    def _connected(self, client: viser.ClientHandle) -> None:
        try:
            with client.atomic():
                page = FlipPage(client, self._scene, self.stage, self.story, self._thumbnails, self._painter)
        except Exception:
            logging.getLogger(__name__).exception("a page could not be built")
            client.add_notification("The page could not be built", "See the terminal for the reason.", color="red")
            return
        with self._lock:
            self.pages[client.client_id] = page
        client.flush()

    def _disconnected(self, client: viser.ClientHandle) -> None:
        with self._lock:
            page = self.pages.pop(client.client_id, None)
        if page is not None:
            page.close()
