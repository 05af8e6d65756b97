"""Reference mesh layer: the edges of the mesh at the reference moment A."""

import viser

from app.debugger.compare import look_up
from app.debugger.run_state import RunState
from app.layers.wireframe import COARSE, MAX_RUNNING_EDGES, Wireframe
from app.page_state.page_state import PageState
from app.palette import REFERENCE
from app.stage import Stage
from fairing.mesh import Mesh


class ReferenceMeshLayer:
    """The edges of A, without those that coincide with the current mesh."""

    def __init__(self, client: viser.ClientHandle, stage: Stage, mesh: Mesh) -> None:
        self._follows_a_run = len(mesh.edges) <= MAX_RUNNING_EDGES
        self._wire = Wireframe(
            client, stage, "/mesh/reference", mesh, REFERENCE, 2.5 if len(mesh.edges) < COARSE else 1.4
        )

    def show(self, state: RunState, page_state: PageState) -> None:
        compared = look_up(page_state.reference, state)
        follows = self._follows_a_run or not state.is_moving
        if compared is not None and follows:
            self._wire.show(compared.vertices, unless_at=state.vertices)
        else:
            self._wire.hide()
