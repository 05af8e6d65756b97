"""What is costly to make again, kept up to a number of bytes."""

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

import numpy as np

K = TypeVar("K", bound=Hashable)


class BoundedCache(Generic[K]):
    """Tuples of arrays by key, those used last, up to `room` bytes; safe to use from several threads."""

    def __init__(self, room: int) -> None:
        self._room = room
        self._kept: OrderedDict[K, tuple[np.ndarray, ...]] = OrderedDict()
        self._lock = threading.Lock()

    def get(self, key: K, make: Callable[[], tuple[np.ndarray, ...]]) -> tuple[np.ndarray, ...]:
        """What was kept for a key, else what `make` returns. They are not to be written to."""
        with self._lock:
            if key in self._kept:
                self._kept.move_to_end(key)
                return self._kept[key]
        arrays = make()
        with self._lock:
            self._kept[key] = arrays
            while sum(array.nbytes for kept in self._kept.values() for array in kept) > self._room:
                self._kept.popitem(last=False)
        return arrays
