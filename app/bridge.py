"""From a click on HTML of our own to Python.

viser shows any HTML but tells nobody about clicks on it. Its own widgets do, and each has its uuid as the id of its
element (not documented, held by a test): so a click presses an invisible viser button, or types into a viser number.
"""

import math
from collections.abc import Callable

import viser

from fairing.errors import InputError

NOTHING = -1.5  # what an invisible number rests at


class Bridge:
    """Invisible widgets in the container that is open while they are made. It must be on show itself (not a tab)."""

    def __init__(self, gui: viser.GuiApi, guarded: Callable[[Callable[..., None]], Callable[..., None]]) -> None:
        self._gui, self._guarded = gui, guarded
        self._hidden: list[str] = []

    def button(self, on_press: Callable[[], None]) -> str:
        """JavaScript that calls `on_press`."""
        handle = self._gui.add_button("hidden")
        call = self._guarded(on_press)
        handle.on_click(lambda _: call())
        self._hidden.append(f"div:has(> button[id='{handle._impl.uuid}'])")
        return f"document.getElementById('{handle._impl.uuid}').click()"

    def number(self, on_value: Callable[[object], None]) -> Callable[[str], str]:
        """A function from a JavaScript expression to JavaScript that calls `on_value` with its value."""
        handle = self._gui.add_number("hidden", NOTHING)
        call = self._guarded(on_value)

        @handle.on_update
        def _(event: viser.GuiEvent) -> None:
            if event.client is not None and handle.value != NOTHING:
                value = handle.value
                handle.value = NOTHING  # the browser reports changes only: the same number may come again
                call(value)

        uuid = handle._impl.uuid
        self._hidden.append(f"div:has(> .mantine-Flex-root label[for='{uuid}'])")
        return lambda expression: (
            f"var e=document.getElementById('{uuid}');"
            f"Object.getOwnPropertyDescriptor(HTMLInputElement.prototype,'value').set.call(e,String({expression}));"
            "e.dispatchEvent(new Event('input',{bubbles:true}))"
        )

    @property
    def style(self) -> str:
        """CSS that hides the widgets."""
        return f"{','.join(self._hidden)} {{ display: none !important }}" if self._hidden else ""


def whole_number(value: object, low: int, high: int, name: str) -> int:
    """A number from a browser, checked: browsers may send anything.

    Raises:
        InputError: it is no whole number from `low` to `high`.
    """
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise InputError(f"{name}: expected a number, found something else")
    if value != int(value) or not low <= value <= high:
        raise InputError(f"{name}: expected a whole number from {low} to {high}, found {value:g}")
    return int(value)
