"""The mesh of a moment of the face splits in the 3D view: faces colored by what happens to them, and the part judged last."""

import viser

from app.flips.body import sunk
from app.flips.carving_layers import FRONT_LIGHT
from app.flips.split_film import SplitMesh
from app.flips.split_panels import GROUPS
from app.palette import BACKGROUND, SELECTED
from app.stage import Stage
from app.surface_offset import OFFSET
from app.viser_bridge.line_node import LineNode
from app.viser_bridge.triangle_node import TriangleNode


class SplitLayers:
    """Nothing is shown until `show`."""

    def __init__(self, client: viser.ClientHandle, stage: Stage) -> None:
        self._stage = stage
        self._faces = {
            group: TriangleNode(client, f"/splits/{group.name.lower()}", color) for group, (color, _) in GROUPS.items()
        }
        towards = stage.eye - stage.target
        self._light = client.scene.add_light_directional(
            "/splits/light", intensity=FRONT_LIGHT, visible=False, position=tuple(towards.tolist())
        )
        self._sides = TriangleNode(client, "/splits/sides", BACKGROUND, wireframe=True)
        self._part = LineNode(client, "/splits/part", SELECTED, 3.0, in_front=True)

    def show(self, mesh: SplitMesh | None, *, outside: bool) -> None:
        """Show a mesh, without its faces while a photo is looked through; None hides everything."""
        self._light.visible = mesh is not None
        if mesh is None:
            for node in self._faces.values():
                node.show(None)
            self._sides.show(None)
            self._part.hide()
            return
        corners = self._stage.page_from_world(mesh.vertices)[mesh.faces]
        behind = sunk(corners, OFFSET)
        for group, node in self._faces.items():
            node.show(behind[mesh.groups == group] if outside else None)
        self._sides.show(corners)
        self._part.show(corners[mesh.is_of_part][:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2, 3))
