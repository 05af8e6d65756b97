"""The vertices as marks that can be clicked: spheres, and blocks where they are locked."""

from collections.abc import Callable

import numpy as np
import viser

from app.debugger.history import REJECTIONS
from app.debugger.run_state import RunState
from app.layers.marks import Shape, ball, block, mark_radius
from app.page_state.page_state import PageState
from app.palette import LOCKED, NOW, REJECTED, SELECTED, START
from app.stage import Stage
from fairing.mesh import Mesh

MANY = 1500  # marks, each of fewer triangles then: 5,000 balls of 80 took 0.1 s of every frame drawn by a processor

OnClick = Callable[[int, bool], None]
Watch = Callable[[viser.BatchedMeshHandle], None]


class VerticesLayer:
    """Green at its start, red once it moved, violet if just rejected, grey and square if locked, yellow if selected.

    The current vertex of the selection is larger than the others.
    """

    def __init__(self, client: viser.ClientHandle, stage: Stage, mesh: Mesh, on_click: OnClick, watch: Watch) -> None:
        self._stage, self._radius = stage, mark_radius(stage, mesh)
        self._free = _Marks(
            client, stage, "/vertices/free", ball(0 if len(mesh.vertices) > MANY else 1), mesh, on_click, watch
        )
        self._locked = _Marks(client, stage, "/vertices/locked", block(), mesh, on_click, watch)

    def show(self, state: RunState, page_state: PageState) -> None:
        colors = vertex_colors(state, page_state.selection.vertices)
        scales = np.full(
            len(state.vertices), self._radius * (0.6 if page_state.entered is not None else 1), dtype=np.float32
        )
        scales[list(page_state.selection.vertices)] *= 1.4
        if page_state.selected is not None:
            scales[page_state.selected] *= 1.25
        is_visible = page_state.shows("vertices")
        positions = self._stage.page_from_world(state.vertices)
        for marks, chosen in ((self._free, ~state.locked), (self._locked, state.locked)):
            marks.show(chosen, positions, colors, scales, is_visible)


class _Marks:
    """One node with a mark for every vertex, those that are not to be seen of no size.

    With marks for only some of the vertices it would be made anew whenever others are locked, and a click that meets
    it before the browser has its bindings is lost.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        stage: Stage,
        name: str,
        shape: Shape,
        mesh: Mesh,
        on_click: OnClick,
        watch: Watch,
    ) -> None:
        count = len(mesh.vertices)
        self._handle = client.scene.add_batched_meshes_simple(
            name,
            *shape,
            np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
            stage.page_from_world(mesh.vertices),
            batched_scales=np.zeros(count, dtype=np.float32),
            batched_colors=np.zeros((count, 3), dtype=np.uint8),
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
            visible=False,
        )

        def clicked(event: viser.SceneNodePointerEvent) -> None:
            if event.instance_index is not None and 0 <= event.instance_index < count:
                on_click(event.instance_index, event.modifier == "shift")

        self._handle.on_click(clicked)
        self._handle.on_click(modifier="shift")(clicked)
        watch(self._handle)

    def show(
        self, chosen: np.ndarray, positions: np.ndarray, colors: np.ndarray, scales: np.ndarray, is_visible: bool
    ) -> None:
        """Chosen vertices (n,) bool; positions (n, 3) and scales (n,) in page units, colours (n, 3) uint8, of all."""
        is_visible = is_visible and bool(chosen.any())
        if is_visible:
            self._handle.batched_positions = positions
            self._handle.batched_colors = colors
            self._handle.batched_scales = np.where(chosen, scales, np.float32(0))
        self._handle.visible = is_visible


def vertex_colors(state: RunState, selected: tuple[int, ...]) -> np.ndarray:
    """(n, 3) uint8: what the colour of a mark says about its vertex."""
    colors = np.tile(np.array(START, dtype=np.uint8), (len(state.vertices), 1))
    colors[(state.vertices != state.trace.start).any(axis=1)] = NOW
    record = state.record
    if record is not None:
        colors[record.vertices[np.isin(record.reasons, REJECTIONS)]] = REJECTED
    colors[state.locked] = LOCKED
    colors[list(selected)] = SELECTED
    return colors
