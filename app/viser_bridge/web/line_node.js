// Lines in front of everything: viser 1.1.1 hides lines behind surfaces.
import { callBeforeFrames, meshOf } from "./before_frame.js";

export function drawInFront({ name }) {
  callBeforeFrames(name, (view) => {
    return () => {
      const lines = meshOf(view, name);
      if (!lines) return;
      Object.assign(lines.material, { depthTest: false, depthWrite: false });
      lines.renderOrder = 1;
    };
  });
}
