// Legend in the top left corner of the 3D view, with a button that folds it.
import { aroundView, once } from "./once.js";

export function setOverlay({ content }) {
  window.eigenfairingOverlay = content; // of the newest call, should several wait for the view
  once(aroundView, (parent) => {
    const overlay = document.getElementById("eigenfairing-overlay") ?? newOverlay();
    if (overlay.parentElement !== parent) parent.append(overlay);
    overlay.lastElementChild.innerHTML = window.eigenfairingOverlay;
  });
}

function newOverlay() {
  const overlay = Object.assign(document.createElement("div"), { id: "eigenfairing-overlay", className: "ef" });
  const button = Object.assign(document.createElement("button"), { type: "button", className: "fold" });
  const content = document.createElement("div");
  const fold = (isFolded) => {
    content.hidden = isFolded;
    button.innerHTML = isFolded ? '<span aria-hidden="true">▸</span> Legend' : '<span aria-hidden="true">▾</span>';
    button.title = isFolded ? "Show the legend" : "Fold the legend";
    button.setAttribute("aria-expanded", String(!isFolded));
  };
  button.addEventListener("pointerdown", (event) => event.stopPropagation()); // not a click into the scene
  button.addEventListener("click", () => fold(!content.hidden));
  button.setAttribute("aria-label", "Legend");
  fold(false);
  overlay.append(button, content);
  return overlay;
}
