"""Photo cache: decoded photos, limited by memory."""

from collections import OrderedDict

import numpy as np

from app.pictures.shown_photo import shown_photo
from fairing.scene import Scene

MAX_BYTES = 400 << 20


class PhotoStore:
    """The most recently used photos, at most `MAX_BYTES`. Not thread-safe."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._kept: OrderedDict[int, np.ndarray] = OrderedDict()

    def __getitem__(self, view_id: int) -> np.ndarray:
        """A photo, (h, w, 3) uint8 RGB.

        Raises:
            InputError: the photo or its mask cannot be read.
        """
        if view_id not in self._kept:
            self._kept[view_id] = shown_photo(self._scene.views[view_id])
            while len(self._kept) > 1 and sum(photo.nbytes for photo in self._kept.values()) > MAX_BYTES:
                self._kept.popitem(last=False)
        self._kept.move_to_end(view_id)
        return self._kept[view_id]
