"""Brings a tab to the front. viser 1.1.1 has no call for it, but runs a line in the page; a test holds it."""

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
    client.gui._websock_interface.queue_message(RunJavascriptMessage(source=source))
