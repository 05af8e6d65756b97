"""From a click on HTML of our own to Python.

viser shows any HTML but tells nobody about clicks on it. Its own widgets do: so a press is written into an invisible
line of viser's, which tells the server. (How the line is found in the page is not documented, and held by a test.)
"""

import asyncio
import json
import math
from collections.abc import Callable

import viser

from app.viser_bridge.javascript import run_in_page
from fairing.errors import InputError

# viser tells of changes that follow each other within 50 ms only the last: so each holds the last few presses.
TOLD_TOGETHER = 16
LONGEST = 1000  # letters of a text
_SCRIPT = """
{
  const latest = [];
  let count = 0;
  window.ef = (action, value) => {
    latest.push([++count, action, value ?? null]);
    if (latest.length > %d) latest.shift();
    tell();
  };
  const tell = () => {
    const label = document.querySelector("label[for='%s']");
    if (!label) return void setTimeout(tell, 50);  // the page is still being built
    const line = label.closest('.mantine-Flex-root').querySelector('input');
    const {set} = Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, 'value');
    set.call(line, JSON.stringify(latest));
    line.dispatchEvent(new Event('input', {bubbles: true}));
  };
}
"""


class Bridge:
    """One invisible line in the container that is open; it must be on show itself (not a tab), or it is off the page."""

    def __init__(self, gui: viser.GuiApi, guarded: Callable[[Callable[..., None]], Callable[..., None]]) -> None:
        self._guarded = guarded
        self._actions: list[Callable[[object], None]] = []
        self._handled = 0
        line = gui.add_text("hidden", "")
        take = guarded(self._take)

        @line.on_update
        async def _(event: viser.GuiEvent) -> None:
            if event.client is not None:  # at once and in order, on the server's own thread
                take(line.value)

        uuid = line._impl.uuid
        self.style = f"div:has(> .mantine-Flex-root label[for='{uuid}']) {{ display: none !important }}"
        """CSS that hides the line."""
        run_in_page(gui, _SCRIPT % (TOLD_TOGETHER, uuid))

    def button(self, on_press: Callable[[], None]) -> str:
        """JavaScript that calls `on_press`."""
        return f"ef({self._add(lambda _: on_press())})"

    def number(self, on_value: Callable[[object], None]) -> Callable[[str], str]:
        """A function from a JavaScript expression to JavaScript that calls `on_value` with its value, whatever it is."""
        action = self._add(on_value)
        return lambda expression: f"ef({action},{expression})"

    def text(self, on_text: Callable[[str, bool], None]) -> Callable[[str, str], str]:
        """A function from JavaScript expressions of a text and a truth value to JavaScript that calls `on_text`."""
        action = self._add(lambda sent: on_text(*_text_and_truth(sent)))
        return lambda expression, truth: f"ef({action},[{expression},{truth}])"

    def _add(self, call: Callable[[object], None]) -> int:
        self._actions.append(self._guarded(call))
        return len(self._actions) - 1

    def _take(self, told: object) -> None:
        """Call the actions of the presses that were not known yet; they may take long, so on threads of their own."""
        for number, action, value in _presses(told):
            if number > self._handled:
                self._handled = number
                call = self._actions[whole_number(action, 0, len(self._actions) - 1, "press")]
                asyncio.get_running_loop().run_in_executor(None, call, value)


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


def _presses(told: object) -> list[tuple[int, object, object]]:
    """Count, action and value of the presses that a browser tells of.

    Raises:
        InputError: it tells of something else.
    """
    try:
        found = [(number, action, value) for number, action, value in json.loads(str(told))]
    except (ValueError, TypeError, RecursionError):
        raise InputError("press: expected a list of presses, found something else") from None
    return [(whole_number(number, 1, 10**9, "press"), action, value) for number, action, value in found]


def _text_and_truth(sent: object) -> tuple[str, bool]:
    """What a browser sends through `Bridge.text`, checked.

    Raises:
        InputError: it is something else, or too long.
    """
    if not isinstance(sent, list) or len(sent) != 2 or not isinstance(sent[0], str) or not isinstance(sent[1], bool):
        raise InputError("text: expected a line, found something else")
    if len(sent[0]) > LONGEST:
        raise InputError(f"text: expected at most {LONGEST} letters, found {len(sent[0])}")
    return sent[0], sent[1]
