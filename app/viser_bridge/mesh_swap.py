"""One GLB mesh at a time; the next one is unpacked out of sight before it takes the place of the last."""

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import viser

# A browser needs this long to unpack a new mesh with its texture.
UNPACK_SECONDS = 0.7


class HasGlb(Protocol):
    """Something drawn."""

    @property
    def glb(self) -> bytes: ...


@dataclass(frozen=True, eq=False)
class Drawn:
    """A mesh as the page wants it.

    Attributes:
        glb: the file.
    """

    glb: bytes


class TakingTurns:
    """Two nodes, of which one is in sight. `on_shown` is called when another one could be."""

    def __init__(
        self, client: viser.ClientHandle, name: str, on_shown: Callable[[], None], seconds: float = UNPACK_SECONDS
    ) -> None:
        self._client, self._name, self._seconds = client, name, seconds
        self._on_shown = on_shown
        self._handles: list[viser.GlbHandle] = []
        self._front = 0
        self._on_its_way: tuple[threading.Timer, HasGlb] | None = None
        self._next: HasGlb | None = None
        self._lock = threading.RLock()
        self._visible = False
        self.shown: HasGlb | None = None

    def offer(self, content: HasGlb) -> None:
        """Show this as soon as it is unpacked; of what waits only the newest is kept."""
        with self._lock:
            if self._on_its_way is not None:
                self._next = content if content is not self._on_its_way[1] else None
            elif content is not self.shown:
                self._send(content)

    def forget(self) -> None:
        """What is in sight is of the past: do not show it again."""
        with self._lock:
            self.shown = self._next = None
            self.set_visible(False)

    def set_visible(self, visible: bool) -> None:
        with self._lock, self._client.atomic():
            self._visible = visible
            for side, handle in enumerate(self._handles):
                handle.visible = visible and self.shown is not None and side == self._front

    def close(self) -> None:
        with self._lock:
            self._next = None
            if self._on_its_way is not None:
                self._on_its_way[0].cancel()

    def _send(self, content: HasGlb) -> None:
        if not self._handles:
            self._handles = [
                self._client.scene.add_glb(
                    f"{self._name}_{side}", content.glb, cast_shadow=False, receive_shadow=False, visible=False
                )
                for side in "ab"
            ]
        self._handles[1 - self._front].glb_data = content.glb
        timer = threading.Timer(self._seconds, self._swap, args=(content,))
        timer.daemon = True
        self._on_its_way = (timer, content)
        timer.start()

    def _swap(self, content: HasGlb) -> None:
        with self._lock:
            self._front, self.shown, self._on_its_way = 1 - self._front, content, None
            self.set_visible(self._visible)
            if self._next is not None:
                following, self._next = self._next, None
                self._send(following)
        self._on_shown()
