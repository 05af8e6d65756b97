// Functions of the page that are called before each frame of the 3D view is drawn; viser 1.1.1 has no such hook.
import { once } from "./once.js";

// Calls a function before every frame, in place of an earlier one of this name. `make` receives viser's view, is called once the
// view exists, and returns the function.
export function callBeforeFrames(name, make) {
  once(() => window.__viserMutable?.scene && window.__viserMutable, (view) => {
    window.eigenfairingFrames ??= {};
    window.eigenfairingFrames[name] = make(view);
    // three.js calls this once a frame, after it has updated the matrices of nodes and camera.
    view.scene.onBeforeRender = () => { for (const call of Object.values(window.eigenfairingFrames)) call(); };
    view.requestRender?.();
  });
}

// The three.js mesh of a node, or null.
export function meshOf(view, name) {
  let found = null;
  view.nodeRefFromName?.[name]?.traverse((node) => {
    if (!found && node.isMesh && node.geometry?.attributes?.position) found = node;
  });
  return found;
}
