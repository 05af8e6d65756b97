// Legend in the top left corner of the 3D view, with a button that folds it to its title. Until the user presses it, a legend
// that would cover too much of the view has its title and colour scale alone.
import { aroundView, once } from "./once.js";

const MOST = 0.07; // of the view's area

export function setOverlay({ content }) {
  window.eigenfairingOverlay = content; // of the newest call, should several wait for the view
  once(aroundView, (parent) => {
    const overlay = document.getElementById("eigenfairing-overlay") ?? newOverlay(parent);
    if (overlay.parentElement !== parent) parent.append(overlay);
    overlay.lastElementChild.innerHTML = window.eigenfairingOverlay;
    fit(overlay);
  });
}

function newOverlay(parent) {
  const overlay = Object.assign(document.createElement("div"), { id: "eigenfairing-overlay", className: "ef" });
  const button = Object.assign(document.createElement("button"), { type: "button", className: "fold" });
  button.addEventListener("pointerdown", (event) => event.stopPropagation()); // not a click into the scene
  button.addEventListener("click", () => {
    overlay.dataset.chosen = "true";
    show(overlay, isWhole(overlay) ? "folded" : "");
  });
  button.setAttribute("aria-label", "Legend");
  overlay.append(button, document.createElement("div"));
  show(overlay, "");
  new ResizeObserver(() => fit(overlay)).observe(parent);
  return overlay;
}

function fit(overlay) {
  if (overlay.dataset.chosen || !overlay.parentElement) return;
  show(overlay, "");
  const [legend, view] = [overlay, overlay.parentElement].map((element) => element.getBoundingClientRect());
  if (legend.width * legend.height > MOST * view.width * view.height) show(overlay, "compact");
}

const isWhole = (overlay) => !overlay.matches(".folded, .compact");

// Shows the whole legend, or, as `form`, what the style sheet leaves of it.
function show(overlay, form) {
  const button = overlay.firstElementChild;
  for (const name of ["folded", "compact"]) overlay.classList.toggle(name, name === form);
  button.title = isWhole(overlay) ? "Fold the legend" : "Show the legend";
  button.setAttribute("aria-expanded", String(isWhole(overlay)));
}
