"""Wireframe layer: the edges of the mesh at the start, now, and at the truth."""

import numpy as np
import viser

from app.debugger.run_state import RunState
from app.page_state.page_state import PageState
from app.palette import NOW, RGB, START, TRUTH
from app.stage import SIZE, Stage
from app.viser_bridge.line_node import LineNode
from fairing.mesh import Mesh
from fairing.scene import Scene

MAX_RUNNING_EDGES = 4000  # wireframes with more edges cannot follow a run at 10 frames/s and are hidden while it runs
COARSE = 200  # meshes with fewer edges are drawn with thicker lines
APART = 0.001 * SIZE  # page units; lines at smaller distances would flicker (z-fighting)


class Wireframe:
    """The edges of a mesh in one colour."""

    def __init__(
        self, client: viser.ClientHandle, stage: Stage, name: str, mesh: Mesh, color: RGB, thickness: float
    ) -> None:
        self._stage, self._mesh = stage, mesh
        self._lines = LineNode(client, name, color, thickness)

    def show(self, vertices: np.ndarray, unless_at: np.ndarray | None = None) -> None:
        """Draw the edges at vertices (n, 3), world units, except those whose ends coincide with `unless_at` (n, 3)."""
        points, edges = self._stage.page_from_world(vertices), self._mesh.edges
        if unless_at is not None:
            apart = np.linalg.norm(points - self._stage.page_from_world(unless_at), axis=1) > APART
            edges = edges[apart[edges].any(axis=1)]
        self._lines.show(points[edges])

    def hide(self) -> None:
        self._lines.hide()


class WireframeLayer:
    """Three wireframes: start in green, now in red, truth in blue."""

    def __init__(self, client: viser.ClientHandle, stage: Stage, scene: Scene) -> None:
        self._follows_a_run = len(scene.mesh.edges) <= MAX_RUNNING_EDGES
        thickness = 2.0 if len(scene.mesh.edges) < COARSE else 1.2
        self._start = Wireframe(client, stage, "/mesh/before", scene.mesh, START, thickness)
        self._now = Wireframe(client, stage, "/mesh/now_edges", scene.mesh, NOW, thickness)
        self._true_surface = None if scene.truth is None else scene.truth.surface
        self._truth = (
            None
            if self._true_surface is None
            else Wireframe(client, stage, "/mesh/truth", self._true_surface, TRUTH, 1.5)
        )

    def show(self, state: RunState, page_state: PageState) -> None:
        follows = self._follows_a_run or not state.is_moving
        if follows and page_state.shows("start"):
            self._start.show(state.trace.start, unless_at=state.vertices)
        else:
            self._start.hide()
        if follows and page_state.shows("now"):
            self._now.show(state.vertices)
        else:
            self._now.hide()
        if self._truth is not None and self._true_surface is not None:
            if page_state.shows("truth"):
                self._truth.show(self._true_surface.vertices)
            else:
                self._truth.hide()
