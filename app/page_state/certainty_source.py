"""Certainty source: how well the photos determine the selected vertices, computed while the engine is paused."""

from dataclasses import dataclass

import numpy as np

from app.debugger.controller import Controller
from app.debugger.run_state import Activity, RunState
from app.page_state.page_state import PageState
from app.query_cache import QueryCache
from fairing.judge.certainty import Certainty, certainties
from fairing.mesh import Mesh

MAX_VERTICES = 50
DRAWN_HALF_AXIS = 0.08  # of the mean edge length at the vertex


@dataclass(frozen=True)
class CertaintyKey:
    """The vertices to compute the certainty of.

    Attributes:
        run_id, moment: the mesh.
        vertices: ids; the current vertex comes last.
    """

    run_id: int
    moment: int
    vertices: tuple[int, ...]


class CertaintySource:
    """The certainties that one browser shows."""

    def __init__(self, controller: Controller) -> None:
        self._cache: QueryCache[CertaintyKey, list[Certainty]] = QueryCache(controller.query)

    def request(self, state: RunState, page_state: PageState) -> None:
        """Compute them, if the engine is paused and a vertex is selected."""
        key = certainty_key(state, page_state)
        if key is not None and state.activity is Activity.PAUSED:
            self._cache.request(key, lambda session: certainties(session, np.array(key.vertices), key.moment))

    def latest(self, state: RunState, page_state: PageState) -> tuple[int, list[Certainty]]:
        """The latest certainties of the selected vertices and their moment, perhaps an earlier one; empty without any."""
        found, key = self._cache.latest, certainty_key(state, page_state)
        if found is None or key is None or isinstance(found[1], Exception):
            return state.moment, []
        if (found[0].run_id, found[0].vertices) != (key.run_id, key.vertices):
            return state.moment, []
        return found[0].moment, found[1]


def drawn_half_axis(mesh: Mesh, vertices: np.ndarray, vertex: int) -> float:
    """Length of the shortest half-axis of a vertex's ellipsoid as it is drawn, world units: enlarged to be visible.

    Args:
        vertices: (n, 3) float: positions, world units.
    """
    neighbours = np.unique(mesh.faces[mesh.one_rings[vertex]])
    edges = np.linalg.norm(vertices[neighbours[neighbours != vertex]] - vertices[vertex], axis=1)
    return DRAWN_HALF_AXIS * float(edges.mean())


def certainty_key(state: RunState, page_state: PageState) -> CertaintyKey | None:
    """The current vertex; where the certainty layer is shown, also the last selected ones."""
    selection = page_state.selection
    if selection.current is None:
        return None
    vertices = selection.vertices[-MAX_VERTICES:] if page_state.shows("certainty") else (selection.current,)
    return CertaintyKey(state.run_id, state.moment, vertices)
