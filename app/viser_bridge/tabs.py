"""Navigation within the page: select a tab, scroll to a heading, reload; title of the browser's tab.

viser 1.1.1 has no functions for these.
"""

import json

import viser

from app.viser_bridge.javascript import run_in_page

SCROLL_TRIES = 50  # 0.1 s each: the heading may not have been drawn yet
SCROLLS = 12  # repetitions once it is there: images above it may still be loading


def show_tab(client: viser.ClientHandle, title: str) -> None:
    """Select the tab with this title."""
    source = f"""
        const tab = Array.from(document.querySelectorAll('[role=tab]'))
            .find(tab => tab.textContent.trim() === {json.dumps(title)});
        // Tabs of docked panels handle keys and pointer events, those within a panel clicks.
        if (tab?.hasAttribute('data-dock-tab'))
            tab.dispatchEvent(new KeyboardEvent('keydown', {{key: 'Enter', bubbles: true}}));
        else tab?.click();
    """
    run_in_page(client.gui, f"(() => {{{source}}})()")


def show_heading(client: viser.ClientHandle, title: str) -> None:
    """Scroll to a heading of a panel, as soon as it is there; any input by the user ends it."""
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


def show_top(client: viser.ClientHandle, inside: str) -> None:
    """Scroll the panel with an element, given as a CSS selector, to its top."""
    find = f"document.querySelector({json.dumps(inside)})"
    run_in_page(client.gui, f"{find}?.closest('.mantine-ScrollArea-viewport')?.scrollTo(0, 0)")


def show_field(client: viser.ClientHandle, folder: str, label: str) -> None:
    """Open the folder with this title if it is closed, and scroll to the field with this label, as soon as it is there."""
    source = f"""
        let left = {SCROLL_TRIES};
        const named = text => Array.from(document.querySelectorAll('label, p, div, span')).find(e =>
            e.childElementCount === 0 && e.textContent.trim() === text && e.offsetParent && !e.closest('[role=tab], .ef'));
        const scroll = () => {{
            const field = named({json.dumps(label)}), title = named({json.dumps(folder)});
            if (field) {{
                field.scrollIntoView({{block: 'center'}});
                field.animate([{{color: '#ffd43b'}}, {{}}], 3000);
                return;
            }}
            if (title && left % 10 === 0) title.click();
            if (left-- > 0) setTimeout(scroll, 100);
        }};
        scroll();
    """
    run_in_page(client.gui, f"(() => {{{source}}})()")


def reload_page(client: viser.ClientHandle, after: float) -> None:
    """Reload the page in `after` seconds."""
    run_in_page(client.gui, f"setTimeout(() => location.reload(), {1000 * after:.0f})")


def set_tab_title(client: viser.ClientHandle, title: str) -> None:
    """The title of the browser's tab."""
    run_in_page(client.gui, f"document.title = {json.dumps(title)}")
