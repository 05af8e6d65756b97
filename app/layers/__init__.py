"""Layers: the objects in the 3D view, one class per layer.

Belongs here: every node of viser's scene tree that the debugger shows (surface, wireframes, vertices, cameras, paths,
ellipsoids, drag handle), and the geometry that only these nodes need.

May import: viser, `app.viser_bridge`, `app.page_state`, `app.pictures`, `app.debugger`, the loose modules of `app`, and
`fairing`. Not `app.panels`, and not `app.page`, which creates the layers.

Offers: classes with the interface `Layer`. Each instance serves one browser; its nodes are created in `__init__`.
"""

from typing import Protocol

from app.debugger.run_state import RunState
from app.page_state.page_state import PageState


class Layer(Protocol):
    """One layer of one browser's 3D view."""

    def show(self, state: RunState, page_state: PageState) -> None:
        """Update the layer in the browser."""
        ...
