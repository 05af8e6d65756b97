"""Panels of our own HTML change in place: what stays the same stays the same element.

viser replaces a panel's whole content when anything in it changes. During a run that is several times a second, and a
button that is replaced between a press and its release is not pressed, one that has the focus loses it, and so do
lists their scroll and tooltips their owner. So a few lines run in the page that compare the old content with the new
and carry over only what differs. If viser should set its content in another way one day, panels are replaced as before.
"""

import viser

from app.viser_bridge.javascript import run_in_page

# A button is the same one only as long as it does the same: Run must not become Pause under a finger.
_SCRIPT = """
if (!window.eigenfairingInPlace) {
  window.eigenfairingInPlace = new Map();  // lines that are being typed, by name: a tab that is left forgets its own
  const isSame = (a, b) => a.nodeName === b.nodeName &&
    (a.nodeType !== Node.ELEMENT_NODE || a.getAttribute('onclick') === b.getAttribute('onclick'));
  const change = (from, to) => {
    if (from.nodeType !== Node.ELEMENT_NODE) {
      if (from.data !== to.data) from.data = to.data;
      return;
    }
    // What somebody is typing is newer than what the server writes.
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


def change_in_place(client: viser.ClientHandle) -> None:
    """Make it so in this browser."""
    run_in_page(client.gui, _SCRIPT)
