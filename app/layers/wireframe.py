"""The mesh as lines: at the start, now, and where it should be."""

import numpy as np
import viser

from app.debugger.run_state import RunState
from app.page_state.page_state import PageState
from app.palette import NOW, RGB, START, TRUTH
from app.stage import SIZE, Stage
from fairing.mesh import Mesh
from fairing.scene import Scene

# More lines than this cannot follow a run at ten pictures a second: they are away while it runs.
MAX_RUNNING_EDGES = 4000
COARSE = 200  # edges: fewer than these are drawn thicker
APART = 0.001 * SIZE  # lines nearer than this would only flicker through each other


class Wireframe:
    """The edges of a mesh in one colour."""

    def __init__(
        self, client: viser.ClientHandle, stage: Stage, name: str, mesh: Mesh, color: RGB, thickness: float
    ) -> None:
        self._stage, self._mesh = stage, mesh
        self._lines = client.scene.add_line_segments(
            name,
            stage.page_from_world(mesh.vertices)[mesh.edges],
            color,
            thickness=thickness,
            thickness_units="screen",
            visible=False,
        )

    def move(self, vertices: np.ndarray, unless_at: np.ndarray | None = None) -> None:
        """Put the vertices there; leave out edges whose ends lie at `unless_at`, both (n, 3), world units."""
        points, edges = self._stage.page_from_world(vertices), self._mesh.edges
        if unless_at is not None:
            apart = np.linalg.norm(points - self._stage.page_from_world(unless_at), axis=1) > APART
            edges = edges[apart[edges].any(axis=1)]
        # A node without any line would be an error in the browser: one of no length stands for it.
        self._lines.points = points[edges] if len(edges) else np.repeat(points[:1], 2, axis=0)[None]

    def set_visible(self, visible: bool) -> None:
        self._lines.visible = visible


class WireframeLayer:
    """Start green, now red, truth blue."""

    def __init__(self, client: viser.ClientHandle, stage: Stage, scene: Scene) -> None:
        self._follows_a_run = len(scene.mesh.edges) <= MAX_RUNNING_EDGES
        thickness = 2.0 if len(scene.mesh.edges) < COARSE else 1.2
        self._start = Wireframe(client, stage, "/mesh/before", scene.mesh, START, thickness)
        self._now = Wireframe(client, stage, "/mesh/now_edges", scene.mesh, NOW, thickness)
        self._truth = (
            Wireframe(client, stage, "/mesh/truth", scene.truth.surface, TRUTH, 1.5)
            if scene.truth is not None
            else None
        )

    def show(self, state: RunState, page_state: PageState) -> None:
        follows = self._follows_a_run or not state.is_moving
        if follows:
            self._start.move(state.trace.start, unless_at=state.vertices)
            self._now.move(state.vertices)
        self._start.set_visible(page_state.shows("start") and follows)
        self._now.set_visible(page_state.shows("now") and follows)
        if self._truth is not None:
            self._truth.set_visible(page_state.shows("truth"))
