"""Message buffers that threads may fill while the event loop waits for them.

viser 1.1.1 sets an asyncio event from the thread that pushes a message, although such events belong to the event loop alone.
If the loop begins to wait at that moment, the push fails ("deque mutated during iteration") and the page misses a change; or
the waiter is woken from the wrong thread. viser sets the event from the event loop, too, which suffices.
"""

import asyncio
from contextlib import suppress
from dataclasses import dataclass, field

from viser.infra import _infra
from viser.infra._async_message_buffer import AsyncMessageBuffer


class MessageEvent(asyncio.Event):
    """An event that only its event loop sets; in other threads `set` does nothing."""

    def set(self) -> None:
        """Set the event and wake those who wait, if an event loop runs in this thread."""
        with suppress(RuntimeError):
            asyncio.get_running_loop()
            super().set()


@dataclass
class MessageBuffer(AsyncMessageBuffer):
    """viser's buffer with such an event."""

    message_event: asyncio.Event = field(default_factory=MessageEvent)


def use_message_buffers() -> None:
    """Let all servers and clients of viser use `MessageBuffer`."""
    _infra.AsyncMessageBuffer = MessageBuffer  # pyright: ignore[reportPrivateImportUsage]
