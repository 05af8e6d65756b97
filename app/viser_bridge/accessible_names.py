"""Accessible names of viser's own widgets.

In viser 1.1.1 sliders, number inputs and the icons of the main panel have no accessible name. A script in the page gives them
the name that stands beside them, whenever the page has changed.
"""

import viser

from app.viser_bridge.javascript import run_in_page

_SCRIPT = """
if (!window.eigenfairingNames) {
  const icons = {'tabler-icon-list-search': 'All commands', 'tabler-icon-adjustments': 'Viewer settings'};
  const set = (element, name) => {
    if (name && element.getAttribute('aria-label') !== name) element.setAttribute('aria-label', name);
  };
  const label = () => {
    for (const widget of document.querySelectorAll('[role=slider]:not([aria-labelledby]), .mantine-Flex-root input')) {
      let row = widget.closest('.mantine-Flex-root');  // a slider stands with its number in a row within the named one
      while (row && !row.querySelector(':scope > * label, :scope > label'))
        row = row.parentElement.closest('.mantine-Flex-root');
      set(widget, row?.querySelector(':scope > * label, :scope > label').textContent.trim());
    }
    for (const button of document.querySelectorAll('button:not(.ef button)')) {
      if (button.textContent.trim() || (button.getAttribute('aria-label') && !button.dataset.named)) continue;
      const icon = [...(button.querySelector('svg')?.classList ?? [])].find(name => name.startsWith('tabler-icon-'));
      button.dataset.named = 'yes';
      set(button, icons[icon] ?? (icon ?? 'button').replace('tabler-icon-', '').replaceAll('-', ' '));
    }
  };
  let due = 0;
  window.eigenfairingNames = new MutationObserver(() => { due ||= setTimeout(() => { due = 0; label(); }, 200); });
  window.eigenfairingNames.observe(document.body, {childList: true, subtree: true, attributeFilter: ['aria-label']});
  label();
}
"""


def name_widgets(client: viser.ClientHandle) -> None:
    """Install the script in this browser's page."""
    run_in_page(client.gui, _SCRIPT)
