"""The mesh of a flip record in the 3D view: its edges, colored by what happens to them, and its faces, flat or textured."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import viser

from app.background_worker import BackgroundWorker
from app.flips.film import Edges, FlipFilm
from app.palette import HAND, NOW, REJECTED, RGB, SELECTED, START, SURFACE
from app.pictures.texturer import TexturedMesh, paint
from app.stage import Stage
from app.viser_bridge.line_node import LineNode
from app.viser_bridge.mesh_swap import DoubleBufferedMesh
from fairing.mesh import Mesh
from fairing.scene import Scene

# Color, meaning and thickness in px of each kind of edge, in the order of `Edges`.
MEANINGS: dict[str, tuple[RGB, str, float]] = {
    "kept": (START, "as at the start", 1.2),
    "came": (NOW, "made by a flip", 1.8),
    "to_go": (REJECTED, "inconsistent: a later flip removes it", 1.8),
    "new": (SELECTED, "made by the last flip", 4.0),
    "gone": (HAND, "removed by the last flip", 2.0),
}


class FlipLayers:
    """The mesh at one moment. The texture follows once it has been computed; none is computed while the record plays."""

    def __init__(
        self,
        client: viser.ClientHandle,
        stage: Stage,
        scene: Scene,
        film: FlipFilm,
        painter: BackgroundWorker,
        on_painted: Callable[[], None],
    ) -> None:
        self._client, self._stage, self._scene, self._film, self._painter = client, stage, scene, film, painter
        self._points = stage.page_from_world(scene.mesh.vertices)
        self._plain = client.scene.add_mesh_simple(
            "/mesh/now",
            self._points,
            film.faces_at(0).astype(np.uint32),
            color=SURFACE,
            flat_shading=True,
            side="double",
            cast_shadow=False,
            receive_shadow=False,
        )
        self._lines = {
            name: LineNode(client, f"/edges/{name}", color, thickness)
            for name, (color, _, thickness) in MEANINGS.items()
        }
        self._painted = DoubleBufferedMesh(client, "/mesh/painted", on_painted)
        self._shown = -1
        self._wanted = -1

    def show(self, moment: int | None, *, is_playing: bool, is_textured: bool, outside: bool) -> None:
        """Show a moment; None: nothing of the mesh."""
        if moment is None:
            self._shown = self._wanted = -1
            self._painted.clear()
            self._plain.visible = False
            for lines in self._lines.values():
                lines.hide()
            return
        if moment != self._shown:
            self._shown = moment
            self._painted.clear()
            self._plain.faces = self._film.faces_at(moment).astype(np.uint32)
            self._draw(self._film.edges_at(moment))
        if is_textured and outside and not is_playing and self._wanted != moment:
            self._wanted = moment
            self._painter.post(self, lambda: self._paint(moment), lambda found: self._take(moment, found))
        painted = is_textured and outside and not is_playing and self._painted.shown is not None
        self._painted.set_visible(painted)
        self._plain.visible = outside and not painted

    def close(self) -> None:
        self._painted.close()

    def _draw(self, edges: Edges) -> None:
        for name, lines in self._lines.items():
            lines.show(self._points[getattr(edges, name)])

    def _paint(self, moment: int) -> TexturedMesh:
        mesh = self._scene.mesh
        scene = replace(self._scene, mesh=Mesh(mesh.vertices, self._film.faces_at(moment)))
        return paint(scene, self._stage, mesh.vertices)

    def _take(self, moment: int, found: TexturedMesh | Exception) -> None:
        if isinstance(found, Exception):
            raise found
        if moment == self._shown:
            self._painted.offer(found)
