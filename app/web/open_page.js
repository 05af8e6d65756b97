// Opening of a page: its 3D view where the browser has WebGL, and a note where something fails.
import { $ } from "./dom.js";

// The 3D view that `make` returns; null, with a note in its place, where the browser has no WebGL 2.
export function viewOrNote(make) {
  try {
    return make();
  } catch (error) {
    $("no-webgl").hidden = false;
    $("no-webgl").title = String(error);
    return null;
  }
}

// Opens the page; a note in place of the view tells why it could not be opened.
export function openPage(open) {
  open().catch((error) => {
    $("no-webgl").hidden = false;
    $("no-webgl").textContent = `This page could not be opened: ${error}. A browser of 2023 or newer is needed.`;
    throw error;
  });
}
