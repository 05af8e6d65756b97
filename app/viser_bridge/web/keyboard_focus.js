// Widgets keep the focus only while the user types, so that hotkeys keep working.
export function releaseFocusAfterUse() {
  if (window.eigenfairingFocus) return;
  window.eigenfairingFocus = true;
  // Listeners of the window are called last, after those of the widget.
  const isField = (e) => e?.matches?.("input, textarea, select");
  const isTyped = (e) => e?.matches?.("textarea, input:not([type=checkbox]):not([type=radio]):not([type=range])");
  const release = () => { if (isField(document.activeElement)) document.activeElement.blur(); };
  // A click of the user on anything but a text input or its label ends the use of the widget.
  window.addEventListener("click", (event) => {
    if (!event.isTrusted) return; // a warning that a script closes
    const label = event.target.closest?.("label");
    if (!isTyped(event.target) && !isTyped(label?.control)) release();
  });
  // Enter submits a form between key down and key up, and opens a closed dropdown.
  let isDone = false;
  window.addEventListener("keydown", (event) => {
    const field = event.target;
    const opens = field.matches?.("textarea, [aria-haspopup=listbox]:not([aria-expanded=true])");
    isDone = isField(field) && (event.key === "Escape" || (event.key === "Enter" && !opens));
  }, true);
  window.addEventListener("keyup", () => { if (isDone) release(); isDone = false; });
  // The camera controls listen on the document, even to letters that are typed.
  document.body.addEventListener("keydown", (event) => {
    const drives = /^(Key[WASDQE]|Arrow\w+)$/.test(event.code) && !event.ctrlKey && !event.metaKey;
    if (drives && isTyped(event.target)) event.stopPropagation();
  });
}
