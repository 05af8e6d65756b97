"""Surface layer: the mesh textured from the photos, coloured by a quantity, or plain.

While a run moves the mesh, the texture painted last stays on the moving vertices, and is painted again from time to time.
"""

import time

import numpy as np
import viser

from app.debugger.controller import Controller
from app.debugger.run_state import Activity, RunState
from app.layers.surface_colors import SurfaceColors
from app.layers.view_dependent_texture import ViewDependentTexture
from app.page_state.page_state import NOW_SHAPE, START_SHAPE, TRUE_SHAPE, PageState
from app.page_state.pull_source import PullSource
from app.page_state.residual_source import ResidualSource
from app.palette import SURFACE
from app.pictures.coloring import COLORINGS, Legend
from app.pictures.texturer import MOST_FACES, MOST_FACES_VIEW_DEPENDENT, Texturer
from app.stage import Stage
from app.surface_offset import offset_along_normals
from app.viser_bridge.mesh_swap import SIDES, DoubleBufferedMesh
from app.viser_bridge.moving_texture import follow_plain_mesh
from app.viser_bridge.split_view import SplitView
from fairing.scene import Scene

REPAINT_SECONDS = 1.0  # at least, between two textures painted while the mesh moves
# Of one processor's time, at most (ledger: textures during a run).
REPAINT_SHARE = 0.25


class SurfaceLayer:
    """A plain mesh that follows every state, and textured or coloured meshes at the start, now, at the truth and between.

    See `PageState.shape` for the positions of the surface's vertices.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        stage: Stage,
        scene: Scene,
        texturer: Texturer,
        controller: Controller,
        residuals: ResidualSource,
        pulls: PullSource,
    ) -> None:
        self._client, self._stage, self._scene = client, stage, scene
        self._texturer = texturer
        self._plain = client.scene.add_mesh_simple(
            "/mesh/now",
            stage.page_from_world(scene.mesh.vertices),
            scene.mesh.faces.astype(np.uint32),
            color=SURFACE,
            flat_shading=True,
            side="double",
            cast_shadow=False,
            receive_shadow=False,
            visible=False,
        )
        self._textured = {
            shape: DoubleBufferedMesh(client, f"/mesh/textured_{name}", controller.republish)
            for shape, name in ((START_SHAPE, "start"), (NOW_SHAPE, "now"), (TRUE_SHAPE, "truth"), (None, "between"))
        }
        follow_plain_mesh(
            client,
            "/mesh/now",
            [f"/mesh/textured_now_{side}" for side in SIDES],
            offset_along_normals(scene.mesh.vertices, scene, stage),
        )
        self._split = SplitView(
            client,
            [f"/mesh/{name}_{side}" for name in ("textured_start", "colored_start") for side in SIDES],
            ["/mesh/now", *(f"/mesh/{name}_{side}" for name in ("textured_now", "colored") for side in SIDES)],
            ("before", "now"),
        )
        self._repainting: tuple[np.ndarray, float] | None = None
        self._repaint_due = 0.0
        self._view_dependent = ViewDependentTexture(client, stage, texturer, controller.republish)
        self._colors = SurfaceColors(client, stage, scene, texturer, controller, residuals, pulls)
        self._between: tuple[float, np.ndarray, np.ndarray] | None = None
        self.legend: Legend | None = None
        """Legend of the colours shown; None if the surface is not coloured."""
        self.is_painting = False
        """Whether the surface is drawn plain until its texture is painted."""

    def show(self, state: RunState, page_state: PageState) -> None:
        vertices = self.vertices_of(state, page_state.shape)
        self._plain.vertices = self._stage.page_from_world(vertices)
        outside, resting = page_state.entered is None, state.activity is Activity.PAUSED
        front = before = None
        is_view_dependent = False
        self.legend = None
        if outside and state.is_moving:
            if page_state.surface == "textured" and page_state.shape == NOW_SHAPE:
                front = self._moving_texture(vertices)
        elif outside:
            if page_state.surface in COLORINGS:
                front = self._colors.show(state, page_state, vertices, resting)
                self.legend = self._colors.legend
            elif page_state.surface == "textured":
                front = self._texture(page_state.shape, vertices, resting and len(self._scene.mesh.faces) <= MOST_FACES)
                if (
                    page_state.is_view_dependent
                    and not page_state.shows_divider
                    and resting
                    and len(self._scene.mesh.faces) <= MOST_FACES_VIEW_DEPENDENT
                ):
                    front = self._view_dependent.show(vertices) or front
                    is_view_dependent = True
        if not is_view_dependent:
            self._view_dependent.rest()
        if front is not self._colors.now and self.legend is None:
            self._colors.clear()
        if page_state.shows_divider:
            before = self._colors.before if page_state.shows_texels else self._before(state)
        self._split.set(before is not None)
        is_textured = outside and page_state.surface == "textured" and len(self._scene.mesh.faces) <= MOST_FACES
        self.is_painting = is_textured and front is None and not self._texturer.static.has_failed(vertices)
        with self._client.atomic():
            for turns in (*self._textured.values(), self._view_dependent.turns, self._colors.now, self._colors.start):
                turns.set_visible(turns is front or turns is before)
            self._plain.visible = outside and page_state.surface != "none" and front is None

    def close(self) -> None:
        for turns in (*self._textured.values(), self._colors):
            turns.close()
        self._view_dependent.close()

    def vertices_of(self, state: RunState, shape: float) -> np.ndarray:
        """(n, 3) float, world units: vertices for a `PageState.shape`. Equal shapes return the identical array."""
        truth = self._scene.truth.vertices if self._scene.truth is not None else None
        if shape == NOW_SHAPE or (shape > NOW_SHAPE and truth is None):
            return state.vertices
        if shape == START_SHAPE:
            return state.trace.start
        if shape == TRUE_SHAPE and truth is not None:
            return truth
        if self._between is None or self._between[0] != shape or self._between[1] is not state.vertices:
            other = state.trace.start if shape < NOW_SHAPE or truth is None else truth
            share = abs(shape - NOW_SHAPE)
            self._between = (shape, state.vertices, state.vertices + share * (other - state.vertices))
        return self._between[2]

    def _texture(self, shape: float, vertices: np.ndarray, resting: bool) -> DoubleBufferedMesh | None:
        turns = self._textured.get(shape, self._textured[None])
        painted = self._texturer.static.painted(self, vertices) if resting else None
        if painted is not None:
            turns.offer(painted)
        # After a step the previous texture stays, on the new vertices, until the next one is painted.
        is_fit = turns.shown is not None and (shape == NOW_SHAPE or turns.shown is painted)
        return turns if is_fit else None

    def _before(self, state: RunState) -> DoubleBufferedMesh | None:
        """The mesh at the start, for the left of the divider; None until it is painted."""
        turns = self._textured[START_SHAPE]
        if len(self._scene.mesh.faces) <= MOST_FACES and turns.shown is None:
            painted = self._texturer.static.painted(turns, state.trace.start)
            if painted is not None:
                turns.offer(painted)
        return turns if turns.shown is not None else None

    def _moving_texture(self, vertices: np.ndarray) -> DoubleBufferedMesh | None:
        """The texture painted last. A smaller one is painted every `REPAINT_SECONDS`, or less often, see `REPAINT_SHARE`."""
        turns = self._textured[NOW_SHAPE]
        if len(self._scene.mesh.faces) > MOST_FACES:
            return None
        if self._repainting is None and time.monotonic() >= self._repaint_due:
            self._repainting = (vertices, time.monotonic())
        if self._repainting is not None:
            wanted, began = self._repainting
            painted = self._texturer.draft.painted(self, wanted)
            if painted is not None:
                turns.offer(painted)
                self._repainting = None
                self._repaint_due = began + max(REPAINT_SECONDS, painted.cost / REPAINT_SHARE)
        return turns if turns.shown is not None else None
