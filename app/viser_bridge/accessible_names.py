"""Accessible names of viser's own widgets.

In viser 1.1.1 sliders, number inputs, the icons of the main panel and the command palette have no accessible name, and the
titles of folders cannot be reached by keyboard. A script in the page gives them the name that stands beside them, and makes
the titles buttons, whenever the page has changed.
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
    for (const palette of document.querySelectorAll('[role=dialog]:has([class*=mantine-Spotlight])')) {
      set(palette, 'All commands');
      palette.querySelectorAll('.mantine-ScrollArea-viewport').forEach(list => { list.tabIndex = 0; });
    }
    for (const arrow of document.querySelectorAll('.mantine-Paper-root > .mantine-Paper-root > svg[class*=chevron]')) {
      const title = arrow.parentElement;
      title.setAttribute('aria-expanded', arrow.classList.contains('tabler-icon-chevron-up'));
      if (title.role === 'button') continue;
      title.role = 'button';
      title.tabIndex = 0;
      title.addEventListener('keydown', event => {
        if (event.target !== title || !['Enter', ' '].includes(event.key)) return;
        event.preventDefault();
        event.stopPropagation();
        title.click();
      });
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
