"""Hotkeys, each also an entry of the command palette."""

from collections.abc import Callable
from typing import Any

import viser


def add_hotkey(
    client: viser.ClientHandle,
    label: str,
    on_trigger: Callable[..., None],
    key: str | None,
    modifier: str | None = None,
) -> None:
    """Add a palette entry with a key, or without where `key` is None.

    viser 1.1.1 accepts function keys, but its type for keys does not name them.
    """
    hotkey: Any = key
    modifiers: Any = modifier
    client.gui.add_command(label, hotkey=hotkey, modifier=modifiers).on_trigger(on_trigger)


def add_shared_hotkey(
    gui: viser.GuiApi, label: str, on_trigger: Callable[[], None], key: str, modifier: str | None = None
) -> viser.CommandHandle:
    """Add a palette entry with a key for all browsers; returns the handle to remove it with."""
    hotkey: Any = key
    modifiers: Any = modifier
    command = gui.add_command(label, hotkey=hotkey, modifier=modifiers)
    command.on_trigger(lambda _: on_trigger())
    return command
