"""Profile panel: the energy of the faces around the selected vertex while it alone is moved along x, y or z."""

import numpy as np
import viser

from app.debugger.controller import Controller
from app.debugger.energy_profile import EnergyProfile, energy_profile, reach_at
from app.debugger.run_state import Activity, RunState
from app.html import number, text
from app.page_state.page_state import PageState
from app.palette import AXIS_CURVES, css
from app.query_cache import QueryCache
from app.viser_bridge.drawn_elements import profile_element
from app.viser_bridge.html_panel import HtmlPanel
from fairing.mesh import Mesh

Key = tuple[int, int, int]
"""Run, moment and vertex."""

_HINT = (
    "Energy of the photos in the faces around the vertex while it alone is moved, with the cells of the moment. The dots mark "
    "where it is. Flat: the photos do not determine the position along this axis."
)


class ProfilePanel:
    """For the current vertex of the selection, computed while the engine is paused. While the run moves, it names the moment
    that it belongs to."""

    def __init__(self, gui: viser.GuiApi, mesh: Mesh, controller: Controller) -> None:
        self._mesh = mesh
        self._cache: QueryCache[Key, EnergyProfile | None] = QueryCache(controller.query)
        self._wanted: Key | None = None
        self._panel = HtmlPanel(gui)

    def show(self, state: RunState, page_state: PageState) -> None:
        vertex = page_state.selected
        if vertex is None:
            self._wanted = None
            self._cache.clear()
            self._panel.set("")
            return
        self._wanted = key = (state.run_id, state.moment, vertex)
        if state.activity is Activity.PAUSED:
            reach = reach_at(state.vertices, self._mesh.faces[self._mesh.one_rings[vertex]], vertex)
            self._cache.request(
                key, lambda session: energy_profile(session, vertex, key[1], reach, lambda: self._wanted == key)
            )
        self._panel.set(self._content(key))

    def _content(self, key: Key) -> str:
        run_id, moment, vertex = key
        latest = self._cache.latest
        if latest is None or (latest[0][0], latest[0][2]) != (run_id, vertex):
            return "<h4>Energy along the axes</h4><div class='dim'>Computing…</div>"
        (_, of_moment, _), found = latest
        when = "" if of_moment == moment else f" at moment {of_moment}"
        head = f"<h4>Energy along the axes{when}</h4>"
        if isinstance(found, Exception):
            return f"{head}<div class='note rejected'>{text(found)}</div>"
        if found is None:
            return f"{head}<div class='dim'>Unknown: no face around the vertex is used.</div>"
        return f"{head}<div title='{text(_HINT)}'>{profile_element(_drawn(vertex, found))}</div>"


def _drawn(vertex: int, found: EnergyProfile) -> dict[str, object]:
    """Data of the plot."""
    reach = number(float(found.offsets[-1]), 2)
    return {
        "vertex": vertex,
        "offsets": found.offsets.tolist(),
        "lines": np.asarray(found.lines).tolist(),
        "at": [0, 0, 0],
        "colors": [css(color) for color in AXIS_CURVES],
        "labels": [f"\u2212{reach}", "0", f"+{reach} world units"],
        "distance": f"{reach} world units",
    }
