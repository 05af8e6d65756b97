"""The mesh as a surface: painted from the photos when the run rests, plain while it moves."""

import threading

import numpy as np
import viser

from app.palette import SURFACE
from app.run_state import Activity, RunState
from app.stage import Stage
from app.texturer import TexturedMesh, Texturer
from app.view import View
from fairing.mesh import Mesh

# A browser needs this long to unpack a new textured mesh; it stays hidden until then, so that nothing blinks.
UNPACK_SECONDS = 0.7


class SurfaceLayer:
    """One plain mesh that follows every state, and two textured ones that take turns."""

    def __init__(self, client: viser.ClientHandle, stage: Stage, mesh: Mesh, texturer: Texturer) -> None:
        self._client, self._stage, self._texturer = client, stage, texturer
        self._plain = client.scene.add_mesh_simple(
            "/mesh/now",
            stage.page_from_world(mesh.vertices),
            mesh.faces.astype(np.uint32),
            color=SURFACE,
            flat_shading=True,
            side="double",
            cast_shadow=False,
            receive_shadow=False,
            visible=False,
        )
        self._textured: list[viser.GlbHandle] = []
        self._front = 0
        self._shown: TexturedMesh | None = None
        self._unpacking: threading.Timer | None = None
        self._lock = threading.Lock()
        self._wants_texture = False
        self._wants_surface = False

    def show(self, state: RunState, view: View) -> None:
        self._plain.vertices = self._stage.page_from_world(state.vertices)
        outside = view.entered is None
        resting = not state.is_moving
        with self._lock:
            self._wants_texture = view.shows("textured") and outside and resting
            self._wants_surface = outside and (view.shows("surface") or view.shows("textured"))
        if self._wants_texture:
            if state.activity is Activity.PAUSED:
                self._texturer.request(state.vertices)
            newest = self._texturer.newest
            if newest is not None and newest is not self._shown and self._unpacking is None:
                self._send(newest)
        if state.is_moving:
            self._shown = None  # what is painted is of the past
        self._apply()

    def close(self) -> None:
        if self._unpacking is not None:
            self._unpacking.cancel()

    def _send(self, newest: TexturedMesh) -> None:
        back = 1 - self._front
        if len(self._textured) < 2:
            for side in "ab":
                name = f"/mesh/textured_{side}"
                self._textured.append(
                    self._client.scene.add_glb(name, newest.glb, cast_shadow=False, receive_shadow=False, visible=False)
                )
        self._textured[back].glb_data = newest.glb
        self._unpacking = threading.Timer(UNPACK_SECONDS, self._swap, args=(back, newest))
        self._unpacking.daemon = True
        self._unpacking.start()

    def _swap(self, back: int, newest: TexturedMesh) -> None:
        with self._lock:
            self._front, self._shown, self._unpacking = back, newest, None
        self._apply()
        following = self._texturer.newest
        if self._wants_texture and following is not None and following is not newest:
            self._send(following)

    def _apply(self) -> None:
        with self._lock, self._client.atomic():
            painted = self._wants_texture and self._shown is not None
            for side, handle in enumerate(self._textured):
                handle.visible = painted and side == self._front
            self._plain.visible = self._wants_surface and not painted
