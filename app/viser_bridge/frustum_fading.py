"""Frustum fading: camera frusta between the viewer and a mesh are faint, and clicks pass through large ones."""

import json

import viser

from app.viser_bridge.before_frame import FIND_MESH, call_before_frames

OPACITY = 0.1
IN_THE_WAY = 0.5  # of the mesh's extent in the window: clicks pass through a faint frustum of this size
SAMPLES = 400  # vertices whose positions in the window give the extent of the mesh

# In normalized device coordinates the mesh is its bounding box. A frustum is a disk around the middle of its photo.
_MAKE = """view => {
  const {mesh: meshName, root, count, radius, opacity, samples, inTheWay} = %s, meshOf = %s;
  const ignore = () => {};
  const fade = (frustum, faded, isLarge) => frustum.traverse(part => {
    const material = part.material;
    if (!material) return;
    if (faded && isLarge && part.raycast !== ignore) {
      part.userData.eigenfairingRaycast = Object.hasOwn(part, 'raycast') ? part.raycast : null;
      part.raycast = ignore;
    } else if (!(faded && isLarge) && part.raycast === ignore) {
      delete part.raycast;
      if (part.userData.eigenfairingRaycast) part.raycast = part.userData.eigenfairingRaycast;
    }
    if ((material.userData.eigenfairingFaded ?? false) === faded) return;
    material.userData.eigenfairingFaded = faded;
    material.userData.eigenfairingTransparent ??= material.transparent;
    material.transparent = faded || material.userData.eigenfairingTransparent;
    material.opacity = faded ? opacity : 1;
    view.requestRender?.();
  });
  return () => {
    const {camera, nodeRefFromName: nodes} = view, mesh = meshOf(view, meshName);
    if (!camera || !mesh || !nodes[root]?.visible) return;
    const point = camera.position.clone(), position = mesh.geometry.attributes.position;
    const focal = camera.projectionMatrix.elements[5];
    let left = Infinity, right = -Infinity, bottom = Infinity, top = -Infinity, depth = 0, seen = 0;
    for (let k = 0; k < position.count; k += Math.ceil(position.count / samples)) {
      point.fromBufferAttribute(position, k).applyMatrix4(mesh.matrixWorld).applyMatrix4(camera.matrixWorldInverse);
      if (point.z >= 0) continue;
      const x = focal * point.x / -point.z, y = focal * point.y / -point.z;
      left = Math.min(left, x), right = Math.max(right, x), bottom = Math.min(bottom, y), top = Math.max(top, y);
      depth -= point.z, seen++;
    }
    for (let k = 0; k < count; k++) {
      const frustum = nodes[`${root}/${k}`];
      if (!frustum) continue;
      let photo = frustum;
      frustum.traverse(part => { if (part.isMesh && part.geometry?.type === 'PlaneGeometry') photo = part; });
      point.setFromMatrixPosition(photo.matrixWorld).applyMatrix4(camera.matrixWorldInverse);
      const x = focal * point.x / -point.z, y = focal * point.y / -point.z, reach = focal * radius / -point.z;
      fade(frustum, point.z < 0 && -point.z < depth / seen
        && x > left - reach && x < right + reach && y > bottom - reach && y < top + reach,
        2 * reach > inTheWay * Math.max(right - left, top - bottom));
    }
  };
}"""


def fade_frusta_before(client: viser.ClientHandle, mesh: str, root: str, count: int, radius: float) -> None:
    """Fade the frusta in front of a mesh in this browser, whenever its camera moves.

    Args:
        mesh: name of the mesh's node.
        root: name of the frusta's parent node; they are called by their numbers.
        count: of frusta.
        radius: of a frustum, scene units.
    """
    parameters = {"mesh": mesh, "root": root, "count": count, "radius": radius}
    parameters |= {"opacity": OPACITY, "samples": SAMPLES, "inTheWay": IN_THE_WAY}
    call_before_frames(client, "frustum fading", _MAKE % (json.dumps(parameters), FIND_MESH))
