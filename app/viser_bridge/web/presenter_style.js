// Presenter layout: a class of the body, and the scales of its columns, which follow the width of the window.

// `smallest`: px, width of the window; `left`: share of it; `unscaled`: px, width of the left column outside the layout; `middle`:
// scale in the smallest window; `event`: receives the window's width.
export function present({ isOn, smallest, left, unscaled, middle, event }) {
  removeEventListener("resize", window.eigenfairingPresenting);
  const measure = () => {
    const share = Math.max(smallest, window.innerWidth) / smallest;
    document.body.style.setProperty("--presenting-left", left * smallest * share / unscaled);
    document.body.style.setProperty("--presenting-right", share);
    document.body.style.setProperty("--presenting-middle", middle * share);
    window.ef(event, window.innerWidth);
  };
  document.body.classList.toggle("presenting", isOn);
  window.eigenfairingPresenting = isOn ? measure : () => {};
  window.eigenfairingPresenting();
  addEventListener("resize", window.eigenfairingPresenting);
}
