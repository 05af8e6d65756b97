"""In-place updates of HTML panels: elements that stay the same are kept.

viser 1.1.1 replaces the whole content of an HTML widget when anything in it changes, during a run several times a second.
A button that is replaced between press and release gets no click, a focused one loses the focus, lists lose their scroll
position. So a script in the page intercepts assignments of `innerHTML`, compares the old content of a panel with the new,
and applies only the differences. If a later viser assigns its content in another way, panels are replaced as before.
"""

import viser

from app.viser_bridge.javascript import run_in_page

# A button is kept only while its action is the same: Run must not become Pause between press and release.
_SCRIPT = """
if (!window.eigenfairingInPlace) {
  window.eigenfairingInPlace = new Map();  // text being typed, by field: a tab that is left loses its own
  const isSame = (a, b) => a.nodeName === b.nodeName &&
    (a.nodeType !== Node.ELEMENT_NODE || a.getAttribute('onclick') === b.getAttribute('onclick'));
  const change = (from, to) => {
    if (from.nodeType !== Node.ELEMENT_NODE) {
      if (from.data !== to.data) from.data = to.data;
      return;
    }
    // Text that is being typed is newer than what the server writes.
    if (from.dataset.written !== to.dataset.written &&
        (document.activeElement !== from || from.value === (from.sent ?? ''))) from.value = to.getAttribute('value');
    for (const {name} of [...from.attributes]) if (!to.hasAttribute(name)) from.removeAttribute(name);
    for (const {name, value} of to.attributes) if (from.getAttribute(name) !== value) from.setAttribute(name, value);
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
  const {get, set} = Object.getOwnPropertyDescriptor(Element.prototype, 'innerHTML');
  Object.defineProperty(Element.prototype, 'innerHTML', {configurable: true, enumerable: true, get, set(content) {
    const isOurs = String(content).startsWith('<div class="ef">');
    if (isOurs && this.firstElementChild?.className === 'ef') {
      const parsed = document.createElement('template');
      set.call(parsed, content);
      changeChildren(this, parsed.content);
      return;
    }
    set.call(this, content);
    if (isOurs) for (const line of this.querySelectorAll('input[data-written]'))
      line.value = window.eigenfairingInPlace.get(line.name) ?? line.value;
  }});
}
"""


def update_in_place(client: viser.ClientHandle) -> None:
    """Install the script in this browser's page."""
    run_in_page(client.gui, _SCRIPT)
