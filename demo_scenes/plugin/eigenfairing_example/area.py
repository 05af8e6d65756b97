"""A panel: the area of the mesh at the present moment."""

import viser

from app.debugger.controller import Controller
from app.debugger.run_state import RunState
from app.page_state.page_state import PageState
from fairing.geometry.normals import unit_normals


class Area:
    """Made once for each browser, in a tab with the name of the entry point; `show` is called with every state."""

    def __init__(self, gui: viser.GuiApi, controller: Controller) -> None:
        self._faces = controller.scene.mesh.faces
        self._text = gui.add_markdown("")

    def show(self, state: RunState, page_state: PageState) -> None:
        _, doubled = unit_normals(state.vertices, self._faces)
        self._text.content = f"Area of the mesh at moment {state.moment}: **{doubled.sum() / 2:.6g}** square units"
