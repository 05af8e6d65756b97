"""Keeps the keys alive: the focus stays in a field only while somebody types there.

The browser gives no hotkeys while a text line, a checkbox or a dropdown has the focus, and a click leaves it there. So
a few lines run in the page that take the focus away once a widget has been used.
"""

import viser

from app.viser_bridge.javascript import run_in_page

_SCRIPT = """
if (!window.eigenfairingFocus) {
  window.eigenfairingFocus = true;
  // The window hears of an event last, when the widget has done its part.
  const isField = e => e?.matches?.('input, textarea, select');
  const isTyped = e => e?.matches?.('textarea, input:not([type=checkbox]):not([type=radio]):not([type=range])');
  const release = () => { if (isField(document.activeElement)) document.activeElement.blur(); };
  // A click that ends anywhere but in a line to type into, or on its label, is done with the widget.
  window.addEventListener('click', event => {
    const label = event.target.closest?.('label');
    if (!isTyped(event.target) && !isTyped(label?.control)) release();
  });
  // Enter sends a form between key down and key up, and opens a dropdown that is closed.
  let isDone = false;
  window.addEventListener('keydown', event => {
    const field = event.target;
    const opens = field.matches?.('textarea, [aria-haspopup=listbox]:not([aria-expanded=true])');
    isDone = isField(field) && (event.key === 'Escape' || (event.key === 'Enter' && !opens));
  }, true);
  window.addEventListener('keyup', () => { if (isDone) release(); isDone = false; });
  // The camera listens at the document, even to letters that are typed: an "energy" would send it flying.
  document.body.addEventListener('keydown', event => {
    const drives = /^(Key[WASDQE]|Arrow\\w+)$/.test(event.code) && !event.ctrlKey && !event.metaKey;
    if (drives && isTyped(event.target)) event.stopPropagation();
  });
}
"""


def release_focus_after_use(client: viser.ClientHandle) -> None:
    """Make it so in this browser."""
    run_in_page(client.gui, _SCRIPT)
