"""Largest size on the screen of a node that is a mesh with a radius of 1 around its origin; shapes of viser 1.1.1 have none."""

import json

import viser

from app.viser_bridge.before_frame import FIND_MESH, call_before_frames

_MAKE = """view => {
  const {name, largest} = %s, find = %s;
  return () => {
    const mesh = find(view, name);
    if (!mesh) return;
    const center = mesh.position.clone().setFromMatrixPosition(mesh.parent.matrixWorld);
    const depth = -center.applyMatrix4(view.camera.matrixWorldInverse).z;
    const radius = mesh.parent.matrixWorld.getMaxScaleOnAxis();
    const most = 2 * largest * depth / (view.camera.projectionMatrix.elements[5] * view.canvas.clientHeight);
    mesh.scale.setScalar(depth > 0 ? Math.min(1, most / radius) : 1);
    mesh.updateMatrixWorld();
  };
}"""


def limit_on_screen(client: viser.ClientHandle, name: str, radius: float) -> None:
    """Draw a node with a radius of at most this many screen pixels, however near the eye is."""
    call_before_frames(client, f"{name} limit", _MAKE % (json.dumps({"name": name, "largest": radius}), FIND_MESH))
