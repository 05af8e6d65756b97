// One camera for all meshes: the slider chooses the frame of each, the button textured or shaded ones.
import { pageData } from "../../web/page_data.js";

const { frames } = pageData();
const pictures = document.querySelectorAll("#meshes img");
const camera = document.getElementById("camera"), look = document.getElementById("look");

function show() {
  const chosen = frames[look.getAttribute("aria-pressed") === "true" ? "shaded" : "textured"];
  pictures.forEach((picture, mesh) => { picture.src = chosen[mesh][camera.valueAsNumber]; });
}

camera.addEventListener("input", show);
look.addEventListener("click", () => {
  look.setAttribute("aria-pressed", String(look.getAttribute("aria-pressed") !== "true"));
  show();
});
document.addEventListener("keydown", (event) => {
  if (event.target === camera || event.ctrlKey || event.metaKey || event.altKey) return;
  const turn = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
  if (!turn) return;
  event.preventDefault();
  camera.valueAsNumber += turn;
  show();
});
