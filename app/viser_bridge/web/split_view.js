// Split view: a divider, with some meshes at its left and others at its right.
import { callBeforeFrames } from "./before_frame.js";
import { aroundView, once } from "./once.js";

// three.js calls `onBeforeRender` and `onAfterRender` of a mesh around its drawing: between them WebGL draws within a rectangle.
export function drawBySides({ sides }) {
  callBeforeFrames("split view", (view) => {
    const nothing = () => {};
    const leave = (renderer) => renderer.getContext().disable(WebGLRenderingContext.SCISSOR_TEST);
    const enter = (side) => (renderer) => {
      const gl = renderer.getContext(), width = gl.drawingBufferWidth, cut = Math.round(width * window.eigenfairingDivider);
      gl.enable(gl.SCISSOR_TEST);
      gl.scissor(side ? cut : 0, 0, side ? width - cut : cut, gl.drawingBufferHeight);
    };
    const entered = [enter(0), enter(1)];
    return () => {
      const isOn = window.eigenfairingDivider !== undefined;
      sides.forEach((names, side) => names.forEach((name) => view.nodeRefFromName?.[name]?.traverse((node) => {
        if (!node.isMesh) return;
        node.onBeforeRender = isOn ? entered[side] : nothing;
        node.onAfterRender = isOn ? leave : nothing;
      })));
    };
  });
}

// Shows a divider over the view, which the user drags, or removes it. `words`: names of both sides.
export function setDivider({ isOn, words }) {
  once(aroundView, (parent) => {
    const view = window.__viserMutable, found = document.getElementById("eigenfairing-divider");
    if (!isOn) {
      found?.remove();
      delete window.eigenfairingDivider;
      view.requestRender?.();
    } else if (!found) addDivider(view, parent, words);
  });
}

function addDivider(view, parent, [left, right]) {
  const divider = document.createElement("div");
  divider.id = "eigenfairing-divider";
  divider.className = "ef";
  divider.tabIndex = 0;
  divider.setAttribute("role", "slider");
  divider.setAttribute("aria-label", `${left} | ${right}`);
  divider.setAttribute("aria-valuemin", 0);
  divider.setAttribute("aria-valuemax", 100);
  divider.innerHTML = `<span>${left} ◂▸ ${right}</span>`;
  const move = (part) => {
    window.eigenfairingDivider = Math.min(0.98, Math.max(0.02, part));
    divider.style.left = `${100 * window.eigenfairingDivider}%`;
    divider.setAttribute("aria-valuenow", Math.round(100 * window.eigenfairingDivider));
    view.requestRender?.();
  };
  divider.addEventListener("pointerdown", (event) => { divider.setPointerCapture(event.pointerId); event.stopPropagation(); });
  divider.addEventListener("pointermove", (event) => {
    if (!divider.hasPointerCapture(event.pointerId)) return;
    const box = parent.getBoundingClientRect();
    move((event.clientX - box.left) / box.width);
  });
  divider.addEventListener("keydown", (event) => {
    const by = { ArrowLeft: -0.02, ArrowRight: 0.02 }[event.key];
    if (!by) return;
    event.preventDefault();
    event.stopPropagation();
    move(window.eigenfairingDivider + by);
  });
  parent.append(divider);
  move(0.5);
}
