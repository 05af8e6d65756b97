"""The vertices as spheres that can be clicked."""

from collections.abc import Callable

import numpy as np
import trimesh.creation
import viser

from app.history import REJECTIONS
from app.palette import LOCKED, NOW, REJECTED, SELECTED, START
from app.run_state import RunState
from app.stage import SIZE, Stage
from app.view import View
from fairing.mesh import Mesh
from fairing.trace import StepReason


class VerticesLayer:
    """One sphere a vertex: green at its start, red once it moved, violet if just rejected, yellow if selected.

    The current vertex of the selection is larger than the others.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        stage: Stage,
        mesh: Mesh,
        on_click: Callable[[int, bool], None],
        watch: Callable[[viser.BatchedMeshHandle], None],
    ) -> None:
        self._stage = stage
        ball_vertices, ball_faces = _icosphere()
        edges = stage.page_from_world(mesh.vertices)[mesh.edges]
        length = float(np.median(np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1)))
        self._radius = float(np.clip(0.07 * length, 0.0022 * SIZE, 0.009 * SIZE))
        n = len(mesh.vertices)
        self._handle = client.scene.add_batched_meshes_simple(
            "/vertices",
            ball_vertices,
            ball_faces,
            np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)),
            stage.page_from_world(mesh.vertices),
            batched_scales=np.full(n, self._radius, dtype=np.float32),
            batched_colors=np.tile(np.array(START, dtype=np.uint8), (n, 1)),
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
        )

        def clicked(event: viser.SceneNodePointerEvent) -> None:
            if event.instance_index is not None and 0 <= event.instance_index < n:
                on_click(int(event.instance_index), event.modifier == "shift")

        self._handle.on_click(clicked)
        self._handle.on_click(modifier="shift")(clicked)
        watch(self._handle)

    def show(self, state: RunState, view: View) -> None:
        self._handle.batched_positions = self._stage.page_from_world(state.vertices)
        self._handle.batched_colors = vertex_colors(state, view.selection.vertices)
        scales = np.full(len(state.vertices), self._radius * (0.6 if view.entered is not None else 1), dtype=np.float32)
        scales[list(view.selection.vertices)] *= 1.4
        if view.selected is not None:
            scales[view.selected] *= 1.25
        self._handle.batched_scales = scales
        self._handle.visible = view.shows("vertices")


def vertex_colors(state: RunState, selected: tuple[int, ...]) -> np.ndarray:
    """(n, 3) uint8: what the colour of a sphere says about its vertex."""
    colors = np.tile(np.array(START, dtype=np.uint8), (len(state.vertices), 1))
    colors[(state.vertices != state.trace.start).any(axis=1)] = NOW
    record = state.record
    if record is not None:
        colors[record.vertices[np.isin(record.reasons, REJECTIONS)]] = REJECTED
        colors[record.vertices[record.reasons == StepReason.LOCKED]] = LOCKED
    colors[list(selected)] = SELECTED
    return colors


def _icosphere() -> tuple[np.ndarray, np.ndarray]:
    """A unit sphere of 80 triangles."""
    ball = trimesh.creation.icosphere(subdivisions=1)
    return np.asarray(ball.vertices, dtype=np.float32), np.asarray(ball.faces, dtype=np.uint32)
