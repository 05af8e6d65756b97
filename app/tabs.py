"""Brings a tab to the front, or loads the page anew. viser 1.1.1 has no calls for it, but runs a line in the page; tests
hold it.
"""

import json

import viser
from viser._messages import RunJavascriptMessage


def show_tab(client: viser.ClientHandle, title: str) -> None:
    """Choose the tab of this title."""
    source = f"""
        const tab = Array.from(document.querySelectorAll('[role=tab]'))
            .find(tab => tab.textContent.trim() === {json.dumps(title)});
        // Tabs of panels listen to the keys and the pointer, those within a panel to clicks.
        if (tab?.hasAttribute('data-dock-tab'))
            tab.dispatchEvent(new KeyboardEvent('keydown', {{key: 'Enter', bubbles: true}}));
        else tab?.click();
    """
    _run(client, source)


def reload_page(client: viser.ClientHandle, after: float) -> None:
    """Load the page anew in so many seconds."""
    _run(client, f"setTimeout(() => location.reload(), {1000 * after:.0f})")


def _run(client: viser.ClientHandle, javascript: str) -> None:
    client.gui._websock_interface.queue_message(RunJavascriptMessage(source=javascript))
