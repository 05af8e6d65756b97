"""View-dependent texture: the mesh with an eigen-texture for the current viewpoint, updated when the camera moves."""

import logging
import threading
from collections.abc import Callable

import numpy as np
import viser

from app.pictures.texturer import TexturedMesh, Texturer, ViewDependentMesh
from app.stage import Stage
from app.viser_bridge.mesh_swap import DoubleBufferedMesh

DECODE_SECONDS = 0.3  # at most 1024 texels: three textures a second
LEAST_TURN = np.radians(0.3)  # camera movement that needs a new texture, as an angle seen from the mesh's centre


class ViewDependentTexture:
    """Renders and sends one texture at a time. When it is shown, the next one is rendered for the viewpoint at that time.

    A browser therefore never receives more textures than it can unpack, and the last texture always belongs to the last
    viewpoint.

    Args:
        on_first: called when the first texture of a new mesh is shown.
    """

    def __init__(
        self, client: viser.ClientHandle, stage: Stage, texturer: Texturer, on_first: Callable[[], None]
    ) -> None:
        self._client, self._stage, self._texturer, self._on_first = client, stage, texturer, on_first
        self._lock = threading.Lock()
        self._mesh: ViewDependentMesh | None = None
        self._is_under_way = False
        self._drawn: tuple[ViewDependentMesh, np.ndarray] | None = None
        self._arrived_at: np.ndarray | None = None
        self.turns = DoubleBufferedMesh(client, "/mesh/view_dependent", self._arrived, DECODE_SECONDS)
        client.camera.on_update(lambda _: self._advance())

    def show(self, vertices: np.ndarray) -> DoubleBufferedMesh | None:
        """Follow the viewpoint with the mesh at vertices (n, 3), world units.

        Returns:
            The nodes that can be shown; None while the mesh is being painted.
        """
        mesh = self._texturer.view_dependent.painted(self, vertices)
        with self._lock:
            self._mesh = mesh
        self._advance()
        is_fit = isinstance(self.turns.shown, TexturedMesh) and self.turns.shown.vertices is vertices
        return self.turns if is_fit else None

    def rest(self) -> None:
        """Stop following the viewpoint."""
        with self._lock:
            self._mesh = None

    def close(self) -> None:
        self.rest()
        self.turns.close()

    def _advance(self) -> None:
        eye = np.array(self._client.camera.position)
        with self._lock:
            mesh = self._mesh
            if mesh is None or self._is_under_way or not self._needs_update(mesh, eye):
                return
            self._is_under_way = True
            self._drawn = (mesh, eye)
        world = self._stage.world_from_page(eye)
        self._texturer.frames.post(self, lambda: mesh.seen_from(world), self._send)

    def _needs_update(self, mesh: ViewDependentMesh, eye: np.ndarray) -> bool:
        if self._drawn is None or self._drawn[0] is not mesh:
            return True
        before = self._drawn[1]
        return float(np.linalg.norm(eye - before)) > LEAST_TURN * float(np.linalg.norm(before))

    def _send(self, found: TexturedMesh | Exception) -> None:
        if isinstance(found, Exception):
            logging.getLogger(__name__).error("the view-dependent texture could not be rendered", exc_info=found)
            with self._lock:
                self._is_under_way = False
        else:
            self.turns.offer(found)

    def _arrived(self) -> None:
        shown = self.turns.shown
        with self._lock:
            self._is_under_way = False
            vertices = shown.vertices if isinstance(shown, TexturedMesh) else None
            is_first = vertices is not self._arrived_at
            self._arrived_at = vertices
        if is_first:  # the surface layer can switch to it now
            self._on_first()
        self._advance()
