// HTML in the top left corner of the 3D view.
import { aroundView, once } from "./once.js";

export function setOverlay({ content }) {
  window.eigenfairingOverlay = content; // of the newest call, should several wait for the view
  once(aroundView, (parent) => {
    let overlay = document.getElementById("eigenfairing-overlay");
    if (!overlay) {
      overlay = document.createElement("div");
      overlay.id = "eigenfairing-overlay";
      overlay.className = "ef";
    }
    if (overlay.parentElement !== parent) parent.append(overlay);
    overlay.innerHTML = window.eigenfairingOverlay;
  });
}
