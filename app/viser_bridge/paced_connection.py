"""Websocket connections that read at most so many messages a second.

viser 1.1.1 handles what it reads at once, in two new tasks a message, however much a client sends. A connection that
reads slowly leaves the rest in the sender's own buffers, so that a flood costs neither memory nor others' time.
"""

import asyncio
import time
from typing import Any

from websockets.asyncio.server import ServerConnection

MAX_MESSAGE_BYTES = 2**20  # viser accepts 50 MiB, for renderings and uploads, which this page does not use
RATE = 200.0  # messages a second; a browser in use sends fewer than 100
BURST = 400  # messages that may come at once


class PacedConnection(ServerConnection):
    """A token bucket: `BURST` messages at once, then `RATE` a second."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._tokens, self._filled_at = float(BURST), time.monotonic()

    async def recv(self, decode: bool | None = None) -> Any:
        now = time.monotonic()
        self._tokens = min(float(BURST), self._tokens + RATE * (now - self._filled_at))
        self._filled_at = now
        if self._tokens < 1:
            await asyncio.sleep((1 - self._tokens) / RATE)
        self._tokens -= 1
        return await super().recv(decode)
