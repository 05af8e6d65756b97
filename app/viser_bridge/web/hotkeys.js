// Further keys of commands, replaced by the one that viser handles, and the keys of dialogs.
export function handleKeys({ keys }) {
  listen();
  for (const [name, key] of keys) window.eigenfairingKeys.set(name, key);
}

function listen() {
  if (window.eigenfairingKeys) return;
  window.eigenfairingKeys = new Map();
  const isTyped = (e) => e?.matches?.("input:not([type=range]):not([type=checkbox]), textarea, select");
  const name = (event) => [event.ctrlKey && "ctrl", event.altKey && "alt", event.metaKey && "meta",
    event.shiftKey && "shift", event.key === " " ? "space" : event.key.toLowerCase()].filter(Boolean).join("+");
  window.addEventListener("keydown", (event) => {
    if (!event.isTrusted) return;
    const dialog = document.querySelector(".ef .dialog");
    if (dialog) {
      if (event.key === "Escape" || event.key === "?") dialog.querySelector(".cross").click();
      if (!["Tab", "Enter", " "].includes(event.key)) { event.preventDefault(); event.stopImmediatePropagation(); }
      return;
    }
    const other = isTyped(event.target) ? null : window.eigenfairingKeys.get(name(event));
    if (!other) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    // Not at the focused element: a tab takes Space for itself.
    document.body.dispatchEvent(new KeyboardEvent("keydown", { ...other, bubbles: true, cancelable: true }));
  }, true);
  window.addEventListener("click", (event) => {
    if (event.target.matches?.(".mantine-Modal-inner")) document.querySelector(".ef .dialog .cross")?.click();
  }, true);
}
