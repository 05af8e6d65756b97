"""Hotkeys, each also an entry of the command palette, and dialogs that Escape closes and that keep keys to themselves.

viser 1.1.1 allows one key for an entry of the palette. Further keys are handled by a script in the page, which replaces
them by that key. viser's dialogs neither close by Escape nor keep hotkeys from the page behind them; the script does both
for a dialog with an element of class `dialog`, which it closes by clicking the element of class `cross` in it.
"""

from collections.abc import Callable, Sequence
from typing import Any

import viser

from app.keys import Key, key_text
from app.viser_bridge.javascript import run_in_page


def add_hotkey(
    client: viser.ClientHandle, label: str, on_trigger: Callable[..., None], keys: Sequence[Key]
) -> tuple[viser.CommandHandle, list[tuple[str, dict[str, object]]]]:
    """Add a palette entry with keys, or without if there are none.

    viser 1.1.1 accepts function keys, but its type for keys does not name them. In the palette it puts the key of the entry
    in brackets behind the description, so that is the last one.

    Returns:
        The entry, and what `handle_keys` needs for the other keys.
    """
    others = keys[:-1]
    key, modifier = keys[-1] if keys else (None, None)
    hotkey: Any = key
    modifiers: Any = modifier
    description = ", ".join(key_text(*other) for other in others) or None
    command = client.gui.add_command(label, description=description, hotkey=hotkey, modifier=modifiers)
    command.on_trigger(on_trigger)
    event = {"key": " " if key == "space" else key, "shiftKey": modifier == "shift"}
    return command, [(_name(*other), event) for other in others]


def handle_keys(client: viser.ClientHandle, keys: Sequence[tuple[str, dict[str, object]]]) -> None:
    """Handle further keys, and the keys of dialogs, in this browser's page."""
    run_in_page(client.gui, "hotkeys", "handleKeys", keys=list(keys))


def _name(key: str, modifier: str | None) -> str:
    return f"{modifier}+{key.lower()}" if modifier else key.lower()


def add_shared_hotkey(
    gui: viser.GuiApi, label: str, on_trigger: Callable[[], None], key: str, modifier: str | None = None
) -> viser.CommandHandle:
    """Add a palette entry with a key for all browsers; returns the handle to remove it with."""
    hotkey: Any = key
    modifiers: Any = modifier
    command = gui.add_command(label, hotkey=hotkey, modifier=modifiers)
    command.on_trigger(lambda _: on_trigger())
    return command
