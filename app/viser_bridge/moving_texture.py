"""Moving texture: a textured mesh follows the vertices of a plain mesh, within the browser.

viser 1.1.1 cannot move the vertices of a GLB mesh, and sending the file again with every step would be too slow. So the page
copies the positions of the plain mesh, which are sent with every state, to the textured ones before each frame.
"""

import json

import viser

from app.viser_bridge.before_frame import FIND_MESH, call_before_frames

# The corners of the textured mesh are those of the plain mesh's faces, in their order.
_MAKE = """view => {
  const {source, targets, offset} = %s, meshOf = %s;
  const written = new WeakMap();  // version of the plain mesh's positions, by textured geometry
  return () => {
    const plain = meshOf(view, source)?.geometry;
    const index = plain?.index?.array, normal = plain?.attributes.normal?.array;
    if (!index || !normal) return;
    const {array: at, version} = plain.attributes.position;
    for (const name of targets) {
      const mesh = meshOf(view, name), position = mesh?.geometry.attributes.position;
      if (!position || position.count !== index.length || written.get(mesh.geometry) === version) continue;
      written.set(mesh.geometry, version);
      const to = position.array, middle = mesh.position.toArray();
      for (let corner = 0; corner < index.length; corner++) {
        const vertex = 3 * index[corner];
        for (let k = 0; k < 3; k++) to[3 * corner + k] = at[vertex + k] - offset * normal[vertex + k] - middle[k];
      }
      position.needsUpdate = true;
      mesh.geometry.computeBoundingSphere();
    }
  };
}"""


def follow_plain_mesh(client: viser.ClientHandle, source: str, targets: list[str], offset: float) -> None:
    """Make textured meshes follow a plain one in this browser.

    Args:
        source: name of the plain mesh's node.
        targets: names of the nodes of the textured meshes; they have the corners of its faces as vertices.
        offset: distance by which the textured surface lies behind the plain one, along the vertex normals, scene units.
    """
    parameters = json.dumps({"source": source, "targets": targets, "offset": offset})
    call_before_frames(client, "moving texture", _MAKE % (parameters, FIND_MESH))
