"""Points, tetrahedra, lines of sight and surfaces of a carving in the 3D view."""

import numpy as np
import viser

from app.flips.body import edges_of
from app.flips.drawing import CLOSED, MESHES, Draughtsman, Drawing
from app.palette import BACKGROUND, FLOW, SELECTED, TRUTH
from app.stage import SIZE, Stage
from app.viser_bridge.line_node import LineNode
from app.viser_bridge.triangle_node import TriangleNode
from fairing.triangulation import Carving

POINT_SIZE = 0.0035 * SIZE  # page units
NEW_SIZE = 1.8 * POINT_SIZE
FRONT_LIGHT = 1.2  # intensity
MOST_LINES = 150  # through a selected tetrahedron


class CarvingLayers:
    """The drawing of a moment, and the selected tetrahedron with the lines of sight that cross it."""

    def __init__(self, client: viser.ClientHandle, stage: Stage, carving: Carving, draughtsman: Draughtsman) -> None:
        self._client, self._carving = client, carving
        self._places = draughtsman.places
        self._cameras = stage.page_from_world(carving.cameras)
        self._meshes = {
            name: TriangleNode(client, f"/carving/{name.replace(' ', '_')}", color, closed=name in CLOSED)
            for name, (color, _) in MESHES.items()
        }
        # The default lights shine from above: the sides of a building, and a section across it, would be dark.
        self._light = client.scene.add_light_directional("/carving/light", intensity=FRONT_LIGHT, visible=False)
        self._rays = LineNode(client, "/carving/rays", TRUTH, 0.8)
        self._sides = TriangleNode(client, "/carving/sides", BACKGROUND, wireframe=True)
        self._through = LineNode(client, "/carving/through", FLOW, 1.2)
        self._selected = LineNode(client, "/carving/selected", SELECTED, 3.0, in_front=True)
        self._clouds = {
            name: client.scene.add_point_cloud(
                f"/carving/{name}", np.zeros((1, 3), np.float32), np.zeros((1, 3), np.uint8), point_size=size,
                point_shape="circle", precision="float32", visible=False,
            )
            for name, size in (("points", POINT_SIZE), ("new_points", NEW_SIZE))
        }  # fmt: skip
        self._shown_points: dict[str, bytes] = {}

    def show(self, drawing: Drawing | None, light: np.ndarray | None = None) -> None:
        """Draw this, lit from a direction (3,), page; None hides everything."""
        if light is not None:
            self._light.position = (float(light[0]), float(light[1]), float(light[2]))
        self._light.visible = drawing is not None
        drawing = drawing or Drawing()
        for name, node in self._meshes.items():
            node.show(drawing.meshes.get(name))
        self._rays.show(drawing.rays)
        self._sides.show(drawing.sides)
        for name, color in (("points", None), ("new_points", SELECTED)):
            self._show_points(name, getattr(drawing, name), color)

    def select(self, tetrahedron: int | None, lines: np.ndarray) -> None:
        """Mark a tetrahedron and the lines of sight (k,) int, by index, that cross it."""
        if tetrahedron is None:
            self._selected.hide()
            self._through.hide()
            return
        self._selected.show(edges_of(self._places[self._carving.mesh.corners[tetrahedron]]))
        point, view = self._carving.lines[lines[:: max(1, -(-len(lines) // MOST_LINES))]].T
        self._through.show(np.stack([self._places[point], self._cameras[view]], axis=1))

    def _show_points(self, name: str, ids: np.ndarray, color: tuple[int, int, int] | None) -> None:
        cloud = self._clouds[name]
        if len(ids) and self._shown_points.get(name) != ids.tobytes():
            self._shown_points[name] = ids.tobytes()
            colors = self._carving.colors[ids] if color is None else np.tile(np.array(color, np.uint8), (len(ids), 1))
            cloud.points, cloud.colors = self._places[ids], colors
        if cloud.visible != (len(ids) > 0):
            cloud.visible = len(ids) > 0
