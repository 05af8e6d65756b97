"""Photo cache: decoded photos, limited by memory."""

import threading
from collections import OrderedDict

import numpy as np

from app.pictures.shown_photo import shown_photo
from fairing.scene import Scene

MAX_BYTES = 400 << 20


class PhotoStore:
    """The most recently used photos, at most `MAX_BYTES`. Safe to use from several threads."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._kept: OrderedDict[int, np.ndarray] = OrderedDict()
        self._lock = threading.Lock()

    def __getitem__(self, view_id: int) -> np.ndarray:
        """A photo, (h, w, 3) uint8 RGB.

        Raises:
            InputError: the photo or its mask cannot be read.
        """
        with self._lock:
            found = self._kept.get(view_id)
        if found is None:
            found = shown_photo(self._scene.views[view_id])
        with self._lock:
            self._kept[view_id] = found
            self._kept.move_to_end(view_id)
            while len(self._kept) > 1 and sum(photo.nbytes for photo in self._kept.values()) > MAX_BYTES:
                self._kept.popitem(last=False)
        return found

    def as_taken(self, view_id: int) -> np.ndarray:
        """A photo without the marks of masked areas, (h, w, 3) uint8 RGB.

        Raises:
            InputError: the photo cannot be read.
        """
        view = self._scene.views[view_id]
        return self[view_id] if view.mask is None else view.photo.load()
