"""Double buffering of textured meshes.

A node of viser 1.1.1 that shows a GLB file blinks when it gets another one: the old mesh is removed before the new one is
decoded. So there are two nodes, and the hidden one decodes the next file before they change places.
"""

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import viser

DECODE_SECONDS = 0.7  # a browser needs this long to decode a new mesh with its texture (ledger: decoding of meshes)

SIDES = "ab"  # the two nodes of a mesh are called by its name, an underscore and one of these


class HasGlb(Protocol):
    """A mesh with its file."""

    @property
    def glb(self) -> bytes: ...


@dataclass(frozen=True, eq=False)
class GlbMesh:
    """A mesh to show.

    Attributes:
        glb: the file.
    """

    glb: bytes


class DoubleBufferedMesh:
    """Two nodes, of which at most one is visible.

    Args:
        on_shown: called when another mesh can be visible.
        seconds: how long a browser needs to decode one; may change from mesh to mesh.
    """

    def __init__(
        self, client: viser.ClientHandle, name: str, on_shown: Callable[[], None], seconds: float = DECODE_SECONDS
    ) -> None:
        self._client, self._name, self.seconds = client, name, seconds
        self._on_shown = on_shown
        self._handles: list[viser.GlbHandle] = []
        self._front = 0
        self._decoding: tuple[threading.Timer, HasGlb] | None = None
        self._next: HasGlb | None = None
        self._lock = threading.RLock()
        self._visible = False
        self._is_closed = False
        self.shown: HasGlb | None = None

    def offer(self, content: HasGlb) -> None:
        """Show this mesh as soon as it is decoded; of several that wait only the newest is kept."""
        with self._lock:
            if self._decoding is not None:
                self._next = content if content is not self._decoding[1] else None
            elif content is not self.shown:
                self._send(content)

    def clear(self) -> None:
        """Hide the mesh, which is out of date; it is not shown again."""
        with self._lock:
            self.shown = self._next = None
            self.set_visible(False)

    def set_visible(self, visible: bool) -> None:
        with self._lock, self._client.atomic():
            self._visible = visible
            for side, handle in enumerate(self._handles):
                handle.visible = visible and self.shown is not None and side == self._front

    def close(self) -> None:
        """Send nothing more."""
        with self._lock:
            self._next, self._is_closed = None, True
            if self._decoding is not None:
                self._decoding[0].cancel()

    def _send(self, content: HasGlb) -> None:
        if self._is_closed:
            return
        if not self._handles:
            self._handles = [
                self._client.scene.add_glb(
                    f"{self._name}_{side}", content.glb, cast_shadow=False, receive_shadow=False, visible=False
                )
                for side in SIDES
            ]
        self._handles[1 - self._front].glb_data = content.glb
        timer = threading.Timer(self.seconds, self._swap, args=(content,))
        timer.daemon = True
        self._decoding = (timer, content)
        timer.start()

    def _swap(self, content: HasGlb) -> None:
        with self._lock:
            if self._is_closed:
                return
            self._front, self.shown, self._decoding = 1 - self._front, content, None
            self.set_visible(self._visible)
            if self._next is not None:
                following, self._next = self._next, None
                self._send(following)
        self._on_shown()
