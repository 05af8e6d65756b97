"""HTML events: from a click on HTML of our own to a Python callback.

viser 1.1.1 displays any HTML but reports no clicks on it. Its own widgets report their changes, so JavaScript writes an
event into an invisible text input of viser's, which sends it to the server. (How the input is found in the page is not
documented; a test covers it.)
"""

import json
import math
from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

import viser

from app.viser_bridge.javascript import run_in_page
from fairing.errors import InputError

# viser sends only the last of several changes within 50 ms, so each carries the last few events.
EVENTS_SENT_TOGETHER = 16
MAX_TEXT = 1000  # characters
_SCRIPT = """
{
  const latest = [];
  let count = 0;
  window.ef = (event, value) => {
    latest.push([++count, event, value ?? null]);
    if (latest.length > %d) latest.shift();
    send();
  };
  const send = () => {
    const label = document.querySelector("label[for='%s']");
    if (!label) return void setTimeout(send, 50);  // the page is still being built
    const input = label.closest('.mantine-Flex-root').querySelector('input');
    const {set} = Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, 'value');
    set.call(input, JSON.stringify(latest));
    input.dispatchEvent(new Event('input', {bubbles: true}));
  };
}
"""

Item = TypeVar("Item")
Guarded = Callable[[Callable[..., None]], Callable[..., None]]
Handler = Callable[[object], None]
"""A callback for the value that a browser sends with an event. Raises InputError for a value that makes no sense."""


def press(call: Callable[[], None]) -> Handler:
    """A handler of events without a value."""
    return lambda _: call()


def integer(call: Callable[[int], None], name: str, low: int, high: int) -> Handler:
    """A handler of integers from `low` to `high`; `name` is what the error message calls them."""
    return lambda value: call(whole_number(value, low, high, name))


def choice_of(call: Callable[[Item], None], choices: Callable[[], Sequence[Item]], name: str) -> Handler:
    """A handler of indices into the present choices, called with the item chosen."""

    def handle(value: object) -> None:
        items = choices()
        call(items[whole_number(value, 0, len(items) - 1, name)])

    return handle


def line_of_text(call: Callable[[str, bool], None]) -> Handler:
    """A handler of `[text, true or false]`."""
    return lambda value: call(*_text_and_flag(value))


class Events:
    """JavaScript for named events: `events("go", 3)` triggers the handler named "go" with the value 3."""

    def __init__(self, numbers: Mapping[str, int]) -> None:
        self._numbers = numbers

    def __call__(self, name: str, value: object = None) -> str:
        """The JavaScript. `value` is an integer, or a JavaScript expression as text; without it the value is null."""
        number = self._numbers[name]
        return f"ef({number})" if value is None else f"ef({number},{value})"


class HtmlEvents:
    """The events of one browser.

    Adds an invisible text input to the container that is open. The input has to stay mounted (not inside a tab), but
    handlers may be added from anywhere.
    """

    def __init__(self, gui: viser.GuiApi, guarded: Guarded) -> None:
        self.guarded, self._gui = guarded, gui
        self._handlers: list[Handler] = []
        self._handled = 0
        text_input = gui.add_text("hidden", "")
        receive = guarded(self._receive)

        @text_input.on_update
        async def _(event: viser.GuiEvent) -> None:
            if event.client is not None:  # a coroutine: viser awaits coroutines in the order of the messages
                receive(text_input.value, event.client.client_id)

        uuid = text_input._impl.uuid
        self.style = f"div:has(> .mantine-Flex-root label[for='{uuid}']) {{ display: none !important }}"
        """CSS that hides the input."""
        run_in_page(gui, _SCRIPT % (EVENTS_SENT_TOGETHER, uuid))

    def named(self, handlers: Mapping[str, Handler]) -> Events:
        """Add handlers, and return the JavaScript that triggers each by its name."""
        return Events({name: self._add(handler) for name, handler in handlers.items()})

    def button(self, on_press: Callable[[], None]) -> str:
        """JavaScript that calls `on_press`."""
        return f"ef({self._add(press(on_press))})"

    def number(self, on_value: Handler) -> Callable[[str], str]:
        """A function from a JavaScript expression to JavaScript that calls `on_value` with its value, unchecked."""
        number = self._add(on_value)
        return lambda expression: f"ef({number},{expression})"

    def text(self, on_text: Callable[[str, bool], None]) -> Callable[[str, str], str]:
        """A function from JavaScript expressions of a text and a flag to JavaScript that calls `on_text`."""
        number = self._add(line_of_text(on_text))
        return lambda expression, flag: f"ef({number},[{expression},{flag}])"

    def _add(self, handler: Handler) -> int:
        self._handlers.append(self.guarded(handler))
        return len(self._handlers) - 1

    def _receive(self, sent: object, client_id: int) -> None:
        """Queue the handlers of the events that were not handled yet; they may take long."""
        for count, number, value in _parse(sent):
            if count > self._handled:
                self._handled = count
                handler = self._handlers[whole_number(number, 0, len(self._handlers) - 1, "event")]
                callbacks = self._gui._thread_executor
                callbacks.submit_for(client_id, handler, value)  # pyright: ignore[reportAttributeAccessIssue]


def whole_number(value: object, low: int, high: int, name: str) -> int:
    """A value from a browser as an integer: browsers may send anything.

    Raises:
        InputError: it is no integer from `low` to `high`.
    """
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise InputError(f"{name}: expected a number, found something else")
    if value != int(value) or not low <= value <= high:
        raise InputError(f"{name}: expected a whole number from {low} to {high}, found {value:g}")
    return int(value)


def _parse(sent: object) -> list[tuple[int, object, object]]:
    """Count, number and value of each event in what a browser sent.

    Raises:
        InputError: it is something else.
    """
    try:
        found = [(count, number, value) for count, number, value in json.loads(str(sent))]
    except (ValueError, TypeError, RecursionError):
        raise InputError("event: expected a list of events, found something else") from None
    return [(whole_number(count, 1, 10**9, "event"), number, value) for count, number, value in found]


def _text_and_flag(sent: object) -> tuple[str, bool]:
    """A text and a flag from a browser, checked.

    Raises:
        InputError: it is something else, or too long.
    """
    if not isinstance(sent, list) or len(sent) != 2 or not isinstance(sent[0], str) or not isinstance(sent[1], bool):
        raise InputError("text: expected a line, found something else")
    if len(sent[0]) > MAX_TEXT:
        raise InputError(f"text: expected at most {MAX_TEXT} letters, found {len(sent[0])}")
    return sent[0], sent[1]
