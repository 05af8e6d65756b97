"""Pull source: the pulls of all terms, computed while the engine is paused and something shows them."""

import numpy as np

from app.debugger.controller import Controller
from app.debugger.moment_pulls import MomentPulls, moment_pulls
from app.debugger.run_state import Activity, RunState
from app.page_state.page_state import PageState
from app.query_cache import QueryCache
from fairing.mesh import Mesh

MAX_VERTICES = 50  # the last selected ones, whose arrows are drawn
KEPT_ENERGIES = 200  # moments
DRAWN_REACH = 0.6  # of the mean edge length at the current vertex: how far arrows of automatic length reach, at most


class PullSource:
    """The pulls that one browser shows. They are of all vertices: another selection needs no new computation."""

    def __init__(self, controller: Controller) -> None:
        self._cache: QueryCache[tuple[int, int], MomentPulls] = QueryCache(controller.query)
        self._energies: dict[tuple[int, int], dict[str, np.ndarray]] = {}

    def at(self, state: RunState) -> MomentPulls | Exception | None:
        """The pulls at the moment shown, or why they cannot be computed; None while they are computed or the mesh moves."""
        key, moment = (state.run_id, state.moment), state.moment
        if state.activity is Activity.PAUSED:
            self._cache.request(key, lambda session: moment_pulls(session, moment))
        found = self._cache.result_for(key)
        if isinstance(found, MomentPulls) and key not in self._energies:
            self._energies[key] = {pull.name: pull.energy for pull in found.pulls}
            if len(self._energies) > KEPT_ENERGIES:
                del self._energies[next(iter(self._energies))]
        return found

    def energies(self, run_id: int) -> dict[int, dict[str, np.ndarray]]:
        """Energies of the terms by vertex, (n,) float, at the moments of a run that were shown so far, in their order."""
        return {moment: found for (run, moment), found in sorted(self._energies.items()) if run == run_id}

    def latest(self, state: RunState) -> tuple[int, MomentPulls] | None:
        """The latest pulls of the current run and their moment, perhaps an earlier one; None without any."""
        found = self._cache.latest
        if found is None or isinstance(found[1], Exception) or found[0][0] != state.run_id:
            return None
        return found[0][1], found[1]

    def drawn(self, state: RunState, page_state: PageState) -> MomentPulls | None:
        """The pulls whose arrows are drawn: of the moment shown, where the layer is shown and a vertex is selected."""
        if page_state.selected is None or not page_state.shows("pulls") or state.is_moving:
            return None
        found = self.at(state)
        return None if isinstance(found, Exception) else found


def chosen_vertices(page_state: PageState) -> list[int]:
    """Ids of the vertices whose arrows are drawn."""
    return list(page_state.selection.vertices[-MAX_VERTICES:])


def arrow_scale(found: MomentPulls, page_state: PageState, mesh: Mesh, vertices: np.ndarray) -> float:
    """Length of the arrows, in lengths of the parts: as chosen, or 1, 2 or 5 times a power of ten that fits the mesh.

    Args:
        vertices: (n, 3) float: positions, world units.
    """
    if page_state.pull_scale:
        return float(page_state.pull_scale)
    vertex = page_state.selected
    assert vertex is not None
    steps = np.array([pull.step[chosen_vertices(page_state)] for pull in found.pulls])
    reach = float(np.linalg.norm(np.cumsum(steps, axis=0), axis=-1).max(initial=0))
    neighbours = np.unique(mesh.faces[mesh.one_rings[vertex]])
    edges = np.linalg.norm(vertices[neighbours[neighbours != vertex]] - vertices[vertex], axis=1)
    if reach == 0 or len(edges) == 0:
        return 1.0
    return round_scale(DRAWN_REACH * float(edges.mean()) / reach)


def round_scale(most: float) -> float:
    """The largest of 1, 2 or 5 times a power of ten that is at most so large; at least 1."""
    power = 10.0 ** np.floor(np.log10(max(most, 1e-300)))
    return max(1.0, float(power * max(factor for factor in (1, 2, 5) if factor * power <= most * (1 + 1e-9))))
