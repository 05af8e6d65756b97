"""Bounded cache: the most recently used tuples of arrays, up to a number of bytes."""

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

import numpy as np

K = TypeVar("K", bound=Hashable)


class BoundedCache(Generic[K]):
    """Tuples of arrays by key; the least recently used are dropped beyond `max_bytes`. Thread-safe."""

    def __init__(self, max_bytes: int) -> None:
        self._max_bytes = max_bytes
        self._kept: OrderedDict[K, tuple[np.ndarray, ...]] = OrderedDict()
        self._lock = threading.Lock()

    def get(self, key: K, make: Callable[[], tuple[np.ndarray, ...]]) -> tuple[np.ndarray, ...]:
        """The cached arrays of a key, else the result of `make`, which is then cached. The arrays must not be written to."""
        with self._lock:
            if key in self._kept:
                self._kept.move_to_end(key)
                return self._kept[key]
        arrays = make()
        with self._lock:
            self._kept[key] = arrays
            while sum(array.nbytes for kept in self._kept.values() for array in kept) > self._max_bytes:
                self._kept.popitem(last=False)
        return arrays
