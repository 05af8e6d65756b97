// Textured meshes follow a plain one, whose vertices are sent with every state.
import { callBeforeFrames, meshOf } from "./before_frame.js";

// The corners of a textured mesh are those of the plain mesh's faces, in their order.
export function followPlainMesh({ source, targets, offset }) {
  callBeforeFrames("moving texture", (view) => {
    const written = new WeakMap(); // version of the plain mesh's positions, by textured geometry
    return () => {
      const plain = meshOf(view, source)?.geometry;
      const index = plain?.index?.array, normal = plain?.attributes.normal?.array;
      if (!index || !normal) return;
      const { array: at, version } = plain.attributes.position;
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
  });
}
