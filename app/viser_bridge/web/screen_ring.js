// A ring of constant size on the screen that faces the camera.
import { callBeforeFrames, meshOf } from "./before_frame.js";

export function keepRingSize({ name, radius }) {
  callBeforeFrames(name, (view) => {
    return () => {
      const ring = meshOf(view, name), { camera, canvas } = view;
      if (!ring) return;
      Object.assign(ring.material, { depthTest: false, depthWrite: false });
      ring.renderOrder = 1;
      // Two of its radii are as high as the camera's image at its depth, times their share of it.
      const depth = -ring.position.clone().applyMatrix4(ring.parent.matrixWorld).applyMatrix4(camera.matrixWorldInverse).z;
      ring.scale.setScalar(2 * radius * depth / (camera.projectionMatrix.elements[5] * canvas.clientHeight));
      ring.parent.getWorldQuaternion(ring.quaternion).invert().multiply(camera.quaternion);
      ring.updateMatrixWorld();
    };
  });
}
