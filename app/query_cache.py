"""One thing at a time that somebody else finds out: asked when it changes, kept when it comes."""

from collections.abc import Callable
from typing import Any, Generic, TypeVar

K = TypeVar("K")
V = TypeVar("V")

Send = Callable[[object, Callable[..., Any], Callable[[Any], None]], None]


class QueryCache(Generic[K, V]):
    """Asks once for every new key; an answer that comes late does not replace a newer one's.

    Args:
        send: given an asker, what to find out, and whom to tell on another thread.
    """

    def __init__(self, send: Send) -> None:
        self._send = send
        self._wanted: K | None = None
        self.newest: tuple[K, V | Exception] | None = None
        """The key last answered, and the answer or what was raised instead."""

    def want(self, key: K, work: Callable[..., V]) -> None:
        """Have it found out, unless this key was the last one asked for."""
        if key != self._wanted:
            self._wanted = key
            self._send(self, work, lambda answer: self._keep(key, answer))

    def found(self, key: K) -> V | Exception | None:
        """The answer for a key, if it is the newest one there."""
        newest = self.newest
        return newest[1] if newest is not None and newest[0] == key else None

    def forget(self) -> None:
        """Query again even for the same key."""
        self._wanted = self.newest = None

    def _keep(self, key: K, answer: V | Exception) -> None:
        if key == self._wanted:
            self.newest = (key, answer)
