"""A ring around a point, of the same size on the screen from any distance, in front of everything.

viser 1.1.1 has lines of constant thickness on the screen, but no shapes of constant size, and hides lines behind surfaces.
"""

import json

import numpy as np
import viser

from app.viser_bridge.before_frame import FIND_MESH, call_before_frames

CORNERS = 48  # of the polygon: its edges are 2 px long at a radius of 15 px

# The ring faces the camera; two of its radii are as high as the camera's image at its depth, times their share of it.
_MAKE = """view => {
  const {name, radius} = %s, meshOf = %s;
  return () => {
    const ring = meshOf(view, name), {camera, canvas} = view;
    if (!ring) return;
    Object.assign(ring.material, {depthTest: false, depthWrite: false});
    ring.renderOrder = 1;
    const depth = -ring.position.clone().applyMatrix4(ring.parent.matrixWorld).applyMatrix4(camera.matrixWorldInverse).z;
    ring.scale.setScalar(2 * radius * depth / (camera.projectionMatrix.elements[5] * canvas.clientHeight));
    ring.parent.getWorldQuaternion(ring.quaternion).invert().multiply(camera.quaternion);
    ring.updateMatrixWorld();
  };
}"""


class ScreenRing:
    """A ring, hidden at first.

    Args:
        radius, thickness: screen px.
    """

    def __init__(
        self, client: viser.ClientHandle, name: str, color: tuple[int, int, int], radius: float, thickness: float
    ) -> None:
        angle = np.linspace(0, 2 * np.pi, CORNERS + 1)
        circle = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
        segments = np.stack([circle[:-1], circle[1:]], axis=1).astype(np.float32)
        self._node = client.scene.add_line_segments(
            name, segments, color, thickness=thickness, thickness_units="screen", visible=False
        )
        call_before_frames(client, name, _MAKE % (json.dumps({"name": name, "radius": radius}), FIND_MESH))

    def show(self, position: np.ndarray | None) -> None:
        """Draw the ring around a position (3,), scene units; None hides it."""
        if position is not None:
            self._node.position = position
        self._node.visible = position is not None
