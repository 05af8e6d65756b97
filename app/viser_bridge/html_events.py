"""HTML events: from a click on HTML of our own to a Python callback.

viser 1.1.1 displays any HTML but reports no clicks on it. Its own widgets report their changes, so JavaScript sends an event
as the change of a text input of viser's that is never displayed. (How the page sends a message is not documented; a test
covers it.)
"""

import json
import math
from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

import viser

from app.viser_bridge.javascript import run_in_page
from fairing.errors import InputError

MAX_TEXT = 1000  # characters
# Of all changes of its widgets within 50 ms viser sends the last, afterwards. An event must come after what the user typed
# before it, so it waits that long after a key. It must not be a change like others: one of the two would be lost.
_AFTER_TYPING = 60  # ms

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
    """The events of one browser."""

    def __init__(self, gui: viser.GuiApi, guarded: Guarded) -> None:
        self.guarded, self._gui = guarded, gui
        self._handlers: list[Handler] = []
        text_input = gui.add_text("events", "", visible=False)
        receive = guarded(self._receive)

        @text_input.on_update
        async def _(event: viser.GuiEvent) -> None:
            if event.client is not None:  # a coroutine: viser awaits coroutines in the order of the messages
                receive(text_input.value, event.client.client_id)

        run_in_page(gui, "html_events", "installEvents", afterTyping=_AFTER_TYPING, uuid=text_input._impl.uuid)

    def named(self, handlers: Mapping[str, Handler]) -> Events:
        """Add handlers, and return the JavaScript that triggers each by its name."""
        return Events({name: self.add(handler) for name, handler in handlers.items()})

    def button(self, on_press: Callable[[], None]) -> str:
        """JavaScript that calls `on_press`."""
        return f"ef({self.add(press(on_press))})"

    def number(self, on_value: Handler) -> Callable[[str], str]:
        """A function from a JavaScript expression to JavaScript that calls `on_value` with its value, unchecked."""
        number = self.add(on_value)
        return lambda expression: f"ef({number},{expression})"

    def add(self, handler: Handler) -> int:
        """Add a handler, and return the number that JavaScript sends its values with."""
        self._handlers.append(self.guarded(handler))
        return len(self._handlers) - 1

    def _receive(self, sent: object, client_id: int) -> None:
        """Queue the handler of an event; it may take long."""
        number, value = _parse(sent)
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


def _parse(sent: object) -> tuple[object, object]:
    """Number and value of an event that a browser sent; its count makes it differ from the one before.

    Raises:
        InputError: it is something else.
    """
    try:
        count, number, value = json.loads(str(sent))
    except (ValueError, TypeError, RecursionError):
        raise InputError("event: expected a count, a number and a value, found something else") from None
    whole_number(count, 1, 10**9, "event")
    return number, value


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
