// Largest size on the screen of a node that is a mesh with a radius of 1 around its origin.
import { callBeforeFrames, meshOf } from "./before_frame.js";

export function limitOnScreen({ name, largest }) {
  callBeforeFrames(`${name} limit`, (view) => {
    return () => {
      const mesh = meshOf(view, name);
      if (!mesh) return;
      const center = mesh.position.clone().setFromMatrixPosition(mesh.parent.matrixWorld);
      const depth = -center.applyMatrix4(view.camera.matrixWorldInverse).z;
      const radius = mesh.parent.matrixWorld.getMaxScaleOnAxis();
      const most = 2 * largest * depth / (view.camera.projectionMatrix.elements[5] * view.canvas.clientHeight);
      mesh.scale.setScalar(depth > 0 ? Math.min(1, most / radius) : 1);
      mesh.updateMatrixWorld();
    };
  });
}
