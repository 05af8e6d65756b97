// In-place updates of HTML panels: of an assigned content only the differences are applied.
export function updateInPlace() {
  if (window.eigenfairingInPlace) return;
  window.eigenfairingInPlace = new Map(); // text being typed, by field: a tab that is left loses its own
  // A button is kept only while its action is the same: Run must not become Pause between press and release.
  const isSame = (a, b) => a.nodeName === b.nodeName &&
    (a.nodeType !== Node.ELEMENT_NODE || a.getAttribute("onclick") === b.getAttribute("onclick"));
  const change = (from, to) => {
    if (from.nodeType !== Node.ELEMENT_NODE) {
      if (from.data !== to.data) from.data = to.data;
      return;
    }
    // Text that is being typed is newer than what the server writes.
    if (from.dataset.written !== to.dataset.written &&
        (document.activeElement !== from || from.value === (from.sent ?? ""))) from.value = to.getAttribute("value");
    for (const { name } of [...from.attributes]) if (!to.hasAttribute(name)) from.removeAttribute(name);
    for (const { name, value } of to.attributes) if (from.getAttribute(name) !== value) from.setAttribute(name, value);
    changeChildren(from, to);
  };
  const changeChildren = (from, to) => {
    let old = from.firstChild;
    for (const next of [...to.childNodes]) {
      let found = old;
      while (found && !isSame(found, next)) found = found.nextSibling;
      if (!found) {
        from.insertBefore(next, old);
        continue;
      }
      while (old !== found) {
        const gone = old;
        old = old.nextSibling;
        gone.remove();
      }
      old = found.nextSibling;
      change(found, next);
    }
    while (old) {
      const gone = old;
      old = old.nextSibling;
      gone.remove();
    }
  };
  const { get, set } = Object.getOwnPropertyDescriptor(Element.prototype, "innerHTML");
  Object.defineProperty(Element.prototype, "innerHTML", {configurable: true, enumerable: true, get, set(content) {
    const isOurs = String(content).startsWith('<div class="ef">');
    if (isOurs && this.firstElementChild?.className === "ef") {
      const parsed = document.createElement("template");
      set.call(parsed, content);
      changeChildren(this, parsed.content);
      return;
    }
    set.call(this, content);
    if (isOurs) for (const line of this.querySelectorAll("input[data-written]"))
      line.value = window.eigenfairingInPlace.get(line.name) ?? line.value;
  }});
}
