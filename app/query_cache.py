"""Query cache: the latest result of a background computation."""

from collections.abc import Callable
from typing import Any, Generic, TypeVar

K = TypeVar("K")
V = TypeVar("V")

Submit = Callable[[object, Callable[..., Any], Callable[[Any], None]], None]


class QueryCache(Generic[K, V]):
    """Computes once for each new key. A result that arrives after a newer key was requested is dropped.

    Args:
        submit: starts a computation; called with a key that identifies this cache, the function to call, and the
            callback for its result, which may be called on any thread.
    """

    def __init__(self, submit: Submit) -> None:
        self._submit = submit
        self._requested: K | None = None
        self.latest: tuple[K, V | Exception] | None = None
        """The key of the latest result, and the result or the exception that was raised instead."""

    def request(self, key: K, compute: Callable[..., V]) -> None:
        """Compute the result for a key, unless this key was the last one requested."""
        if key != self._requested:
            self._requested = key
            self._submit(self, compute, lambda result: self._store(key, result))

    def result_for(self, key: K) -> V | Exception | None:
        """The result for a key if it is the latest one, else None."""
        latest = self.latest
        return latest[1] if latest is not None and latest[0] == key else None

    def clear(self) -> None:
        """Drop the result; the next request is computed even if its key is the same."""
        self._requested = self.latest = None

    def _store(self, key: K, result: V | Exception) -> None:
        if key == self._requested:
            self.latest = (key, result)
