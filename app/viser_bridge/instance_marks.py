"""Instances of one shape, of which some are shown, and which can be clicked."""

from collections.abc import Callable, Sequence

import numpy as np
import viser

from app.viser_bridge.javascript import run_in_page
from app.viser_bridge.linear_colors import linear_from_srgb
from app.viser_bridge.node_events import on_node_click

Shape = tuple[np.ndarray, np.ndarray]

MOST_TRIANGLES = 20_000  # of the instances in view (ledger: vertex mark triangles)
LARGEST = 8.0  # screen px: radius of an instance from nearby, which else would cover what it marks


class InstanceMarks:
    """One node with an instance for every position; those that are hidden have zero size.

    The fewer instances are in view, the more triangles each has, as many in all as a browser without a graphics card draws
    without delay. Instances are not rotated. From nearby they are drawn no larger than `LARGEST`, but can be clicked where they
    would be.

    viser 1.1.1 makes a node anew when its number of instances changes, and a click on it before the browser has its
    bindings is lost, so the number never changes.

    Args:
        shapes: vertices (v, 3) float and faces (f, 3) of an instance, of which one is drawn; the finest first.
        positions: (n, 3) float, scene units, at first.
        on_click: called with the index of an instance and whether Shift was held.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        name: str,
        shapes: Sequence[Shape],
        positions: np.ndarray,
        on_click: Callable[[int, bool], None],
    ) -> None:
        count = len(positions)
        vertices, faces = _joined(shapes)
        self.node = client.scene.add_batched_meshes_simple(
            name,
            vertices,
            faces,
            np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
            positions,
            batched_scales=np.zeros(count, dtype=np.float32),
            batched_colors=np.zeros((count, 3), dtype=np.uint8),
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
            visible=False,
        )

        def clicked(event: viser.SceneNodePointerEvent, with_shift: bool) -> None:
            if event.instance_index is not None and 0 <= event.instance_index < count:
                on_click(event.instance_index, with_shift)

        on_node_click(self.node, clicked)
        limits = {"most": MOST_TRIANGLES, "largest": LARGEST}
        run_in_page(client.gui, "instance_marks", "drawAsOneMesh", name=name, shapes=_parts(shapes), **limits)

    def show(
        self, shown: np.ndarray, positions: np.ndarray, colors: np.ndarray, scales: np.ndarray, is_visible: bool
    ) -> None:
        """Draw the instances of `shown` (n,) bool; positions (n, 3) and scales (n,) in scene units, colors (n, 3) uint8."""
        is_visible = is_visible and bool(shown.any())
        if is_visible:
            self.node.batched_positions = positions
            self.node.batched_colors = linear_from_srgb(colors)
            self.node.batched_scales = np.where(shown, scales, np.float32(0))
        self.node.visible = is_visible


def _joined(shapes: Sequence[Shape]) -> Shape:
    """All shapes as one."""
    faces = [faces + part["first"] for part, (_, faces) in zip(_parts(shapes), shapes, strict=True)]
    return np.concatenate([vertices for vertices, _ in shapes]), np.concatenate(faces).astype(np.uint32)


def _parts(shapes: Sequence[Shape]) -> list[dict[str, int]]:
    """Where each shape is in all of them as one: its first vertex and corner, and how many it has."""
    parts, first, corner = [], 0, 0
    for vertices, faces in shapes:
        parts.append({"first": first, "vertices": len(vertices), "firstCorner": corner, "corners": faces.size})
        first, corner = first + len(vertices), corner + faces.size
    return parts
