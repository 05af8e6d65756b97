"""Malformed requests and messages: one line in the terminal instead of a traceback.

viser 1.1.1 lets what a message's parser raises end the connection's handler, which websockets logs with a traceback;
errors in the handling of a message end a task that nobody awaits, which asyncio logs with a traceback. Anybody who may
connect can send such messages.
"""

import asyncio
import logging
import time
from collections.abc import Awaitable, Callable
from typing import Any

from websockets.asyncio.server import ServerConnection
from websockets.frames import CloseCode

REPEAT_SECONDS = 10.0
"""The same line is logged again after this time."""
LONGEST = 200
"""Characters of an error's text in a line; it may hold parts of the message."""

_log = logging.getLogger(__name__)
Handler = Callable[[ServerConnection], Awaitable[None]]


class _Lines:
    """Logs an error in one line, and repetitions of it at most every `REPEAT_SECONDS`."""

    def __init__(self) -> None:
        self._last, self._at = "", float("-inf")

    def show(self, what: str, error: BaseException) -> None:
        _log.debug(what, exc_info=error)
        reason = " ".join(str(error).split())[:LONGEST]
        line = f"{what} ({type(error).__name__}{f': {reason!a}' if reason else ''})"
        now = time.monotonic()
        if line != self._last or now - self._at > REPEAT_SECONDS:
            self._last, self._at = line, now
            _log.warning(line)


def one_line_each(handler: Handler) -> Handler:
    """The handler of connections, which closes a connection after a message that cannot be parsed and logs one line.

    Called in the server's event loop, whose errors in tasks are logged in one line, too.
    """
    lines = _Lines()

    def on_task_error(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        error = context.get("exception")
        if isinstance(error, Exception):
            lines.show("a malformed message from a browser was ignored", error)
        else:
            loop.default_exception_handler(context)

    async def handle(connection: ServerConnection) -> None:
        try:
            await handler(connection)
        except Exception as error:
            lines.show("a connection was closed after a malformed message from a browser", error)
            await connection.close(CloseCode.INVALID_DATA, "malformed message")

    asyncio.get_running_loop().set_exception_handler(on_task_error)
    return handle


def quiet_logger() -> logging.Logger:
    """The log of a server's connections without handshakes that fail, as port scans and browsers that expect TLS cause."""
    log = logging.getLogger(f"{__name__}.connections")
    if not log.filters:
        log.addFilter(lambda record: record.getMessage() != "opening handshake failed")
    return log
