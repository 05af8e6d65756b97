"""The vertices as marks that can be clicked: spheres, and blocks where they are locked."""

from collections.abc import Callable

import numpy as np
import viser

from app.history import REJECTIONS
from app.layers.marks import Shape, ball, block, mark_radius
from app.palette import LOCKED, NOW, REJECTED, SELECTED, START
from app.run_state import RunState
from app.stage import Stage
from app.view import View
from fairing.mesh import Mesh

MANY = 1500  # marks, each of fewer triangles then: 5,000 balls of 80 took 0.1 s of every frame drawn by a processor

OnClick = Callable[[int, bool], None]
Watch = Callable[[viser.BatchedMeshHandle], None]


class VerticesLayer:
    """Green at its start, red once it moved, violet if just rejected, grey and square if locked, yellow if selected.

    The current vertex of the selection is larger than the others.
    """

    def __init__(self, client: viser.ClientHandle, stage: Stage, mesh: Mesh, on_click: OnClick, watch: Watch) -> None:
        self._radius = mark_radius(stage, mesh)
        self._free = _Marks(
            client, stage, "/vertices/free", ball(0 if len(mesh.vertices) > MANY else 1), on_click, watch
        )
        self._locked = _Marks(client, stage, "/vertices/locked", block(), on_click, watch)

    def show(self, state: RunState, view: View) -> None:
        colors = vertex_colors(state, view.selection.vertices)
        scales = np.full(len(state.vertices), self._radius * (0.6 if view.entered is not None else 1), dtype=np.float32)
        scales[list(view.selection.vertices)] *= 1.4
        if view.selected is not None:
            scales[view.selected] *= 1.25
        is_visible = view.shows("vertices")
        for marks, chosen in ((self._free, ~state.locked), (self._locked, state.locked)):
            marks.show(np.flatnonzero(chosen), state.vertices, colors, scales, is_visible)


class _Marks:
    """Some of the vertices in one node, which is made anew only when others are to be shown."""

    def __init__(
        self, client: viser.ClientHandle, stage: Stage, name: str, shape: Shape, on_click: OnClick, watch: Watch
    ) -> None:
        self._client, self._stage, self._name, self._shape = client, stage, name, shape
        self._on_click, self._watch = on_click, watch
        self._ids = np.zeros(0, dtype=int)
        self._handle: viser.BatchedMeshHandle | None = None

    def show(
        self, ids: np.ndarray, vertices: np.ndarray, colors: np.ndarray, scales: np.ndarray, is_visible: bool
    ) -> None:
        """The vertices (u,) of these ids; positions (n, 3) in world units, colours (n, 3) and scales (n,) of all."""
        positions = self._stage.page_from_world(vertices[ids])
        if not np.array_equal(ids, self._ids):
            self._ids = ids
            self._handle = self._made(positions, colors[ids], scales[ids]) if len(ids) else self._removed()
        if self._handle is not None:
            self._handle.batched_positions = positions
            self._handle.batched_colors = colors[ids]
            self._handle.batched_scales = scales[ids]
            self._handle.visible = is_visible

    def _removed(self) -> None:
        if self._handle is not None:
            self._handle.remove()

    def _made(self, positions: np.ndarray, colors: np.ndarray, scales: np.ndarray) -> viser.BatchedMeshHandle:
        ids = self._ids
        handle = self._client.scene.add_batched_meshes_simple(
            self._name,
            *self._shape,
            np.tile([1.0, 0.0, 0.0, 0.0], (len(ids), 1)),
            positions,
            batched_scales=scales,
            batched_colors=colors,
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
        )

        def clicked(event: viser.SceneNodePointerEvent) -> None:
            if event.instance_index is not None and 0 <= event.instance_index < len(ids):
                self._on_click(int(ids[event.instance_index]), event.modifier == "shift")

        handle.on_click(clicked)
        handle.on_click(modifier="shift")(clicked)
        self._watch(handle)
        return handle


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
