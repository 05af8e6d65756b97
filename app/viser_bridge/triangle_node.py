"""A node of single triangles that may be empty."""

import numpy as np
import viser


class TriangleNode:
    """Triangles of one color. viser 1.1.1 fails in the browser on a mesh without faces: it is hidden then.

    Args:
        closed: they bound bodies, counter-clockwise seen from outside: what faces away need not be drawn.
        wireframe: draw the sides only, 1 px wide: without a graphics card a browser draws them 100 times faster than line
            segments of a thickness.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        name: str,
        color: tuple[int, int, int],
        *,
        closed: bool = False,
        wireframe: bool = False,
    ) -> None:
        self._node = client.scene.add_mesh_simple(
            name,
            np.zeros((3, 3), dtype=np.float32),
            np.zeros((1, 3), dtype=np.uint32),
            color=color,
            wireframe=wireframe,
            flat_shading=not wireframe,
            side="front" if closed else "double",
            cast_shadow=False,
            receive_shadow=False,
            visible=False,
        )
        self._shown: np.ndarray | None = None

    def show(self, triangles: np.ndarray | None) -> None:
        """Draw triangles (m, 3, 3) float, scene units; None or m = 0 hides the node."""
        is_visible = triangles is not None and len(triangles) > 0
        is_new = self._shown is None or triangles is None or not np.array_equal(triangles, self._shown)
        if triangles is not None and is_visible and is_new:
            corners = triangles.reshape(-1, 3)
            n_before = 0 if self._shown is None else self._shown.size // 3
            # Faces never refer to vertices that are not there yet, or no more.
            if len(corners) < n_before:
                self._node.faces = np.arange(len(corners), dtype=np.uint32).reshape(-1, 3)
            self._node.vertices = corners.astype(np.float32)
            if len(corners) > n_before:
                self._node.faces = np.arange(len(corners), dtype=np.uint32).reshape(-1, 3)
            self._shown = triangles
        if self._node.visible != is_visible:
            self._node.visible = is_visible
