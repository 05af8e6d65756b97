// Reports the width of the 3D view whenever it changes.
import { once } from "./once.js";

export function watchWidth({ event }) {
  once(() => window.__viserMutable?.canvas, (canvas) => {
    window.eigenfairingWidth?.disconnect();
    window.eigenfairingWidth = new ResizeObserver(() => { window.ef(event, Math.round(canvas.clientWidth)); });
    window.eigenfairingWidth.observe(canvas);
  });
}
