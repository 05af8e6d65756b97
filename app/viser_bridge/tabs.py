"""Brings a tab to the front, a heading into sight, or loads the page anew. viser 1.1.1 has no calls for it, but runs a
line in the page; tests hold it.
"""

import json

import viser

from app.viser_bridge.javascript import run_in_page

SCROLL_TRIES = 50  # 0.1 s each: what a heading stands over may still be drawn
SCROLLS = 12  # once it is there: pictures above it may still come


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
    run_in_page(client.gui, f"(() => {{{source}}})()")


def show_heading(client: viser.ClientHandle, title: str) -> None:
    """Scroll its panel to a heading, as soon as it is there."""
    source = f"""
        let left = {SCROLL_TRIES};
        const stop = () => {{ left = 0; }};
        for (const kind of ['wheel', 'pointerdown', 'keydown']) addEventListener(kind, stop, {{once: true, capture: true}});
        const scroll = () => {{
            const heading = Array.from(document.querySelectorAll('.ef h4')).find(h => h.textContent === {json.dumps(title)});
            if (heading && left > {SCROLLS}) left = {SCROLLS};
            if (heading && left > 0) heading.scrollIntoView();
            if (left-- > 0) setTimeout(scroll, 100);
        }};
        scroll();
    """
    run_in_page(client.gui, f"(() => {{{source}}})()")


def reload_page(client: viser.ClientHandle, after: float) -> None:
    """Load the page anew in so many seconds."""
    run_in_page(client.gui, f"setTimeout(() => location.reload(), {1000 * after:.0f})")
