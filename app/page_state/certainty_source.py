"""Certainty source: how well the photos determine the selected vertices, computed while the engine is paused."""

from dataclasses import dataclass

import numpy as np

from app.debugger.controller import Controller
from app.debugger.run_state import Activity, RunState
from app.page_state.page_state import PageState
from app.query_cache import QueryCache
from fairing.judge.certainty import Certainty, certainties

MAX_VERTICES = 50


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

    def latest(self, state: RunState, page_state: PageState) -> list[Certainty]:
        """The latest certainties of the selected vertices, perhaps of an earlier moment; empty if there are none."""
        found, key = self._cache.latest, certainty_key(state, page_state)
        if found is None or key is None or isinstance(found[1], Exception):
            return []
        return found[1] if (found[0].run_id, found[0].vertices) == (key.run_id, key.vertices) else []


def certainty_key(state: RunState, page_state: PageState) -> CertaintyKey | None:
    """The current vertex; where the certainty layer is shown, also the last selected ones."""
    selection = page_state.selection
    if selection.current is None:
        return None
    vertices = selection.vertices[-MAX_VERTICES:] if page_state.shows("certainty") else (selection.current,)
    return CertaintyKey(state.run_id, state.moment, vertices)
