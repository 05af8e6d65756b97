"""Residual source: residuals and image flow by face or sample, computed while the engine is paused and they are shown."""

import numpy as np

from app.debugger.controller import Controller
from app.debugger.run_state import Activity, RunState
from app.page_state.page_state import PageState
from app.page_state.pull_source import DRAWN_REACH, round_scale
from app.query_cache import QueryCache
from fairing.judge.face_residuals import FaceResiduals, face_residuals
from fairing.judge.texel_flow import texel_flow
from fairing.judge.texel_residuals import texel_residuals
from fairing.judge.texels import Texels
from fairing.mesh import Mesh
from fairing.run.session import Session

LONG = 0.9  # quantile of the lengths of arrows that may reach as far as `DRAWN_REACH`


class ResidualSource:
    """The residuals and flows that one browser shows: by face for all photos at once, so that another needs no computation."""

    def __init__(self, controller: Controller) -> None:
        self._cache: QueryCache[tuple[int, int, bool], FaceResiduals] = QueryCache(controller.query)
        self._texels: QueryCache[tuple[int, int, int | None, bool], Texels] = QueryCache(controller.query)
        self._start_texels: QueryCache[tuple[int, int, int | None, bool], Texels] = QueryCache(controller.query)

    def at(self, state: RunState, page_state: PageState) -> FaceResiduals | None:
        """The residuals at the moment shown; None while they are computed, or if they cannot be."""
        with_flow, moment = page_state.surface == "flow", state.moment
        key = (state.run_id, moment, with_flow)
        is_shown = page_state.surface in ("residual", "flow") and not page_state.shows_texels
        if is_shown and state.activity is Activity.PAUSED:
            self._cache.request(key, lambda session: face_residuals(session, moment, with_flow=with_flow))
        found = self._cache.result_for(key)
        return None if isinstance(found, Exception) else found

    def texels_at(self, state: RunState, page_state: PageState, *, at_start: bool = False) -> Texels | None:
        """The values at every sample in the chosen photo, or over all, at the moment shown or the start; None while they are
        computed, or if they cannot be."""
        cache, moment = (self._start_texels, 0) if at_start else (self._texels, state.moment)
        view, is_flow = page_state.residual_view, page_state.surface == "flow"

        def measure(session: Session) -> Texels:
            if is_flow and view is not None:
                return texel_flow(session, moment, view)
            return texel_residuals(session, moment, view)

        key = (state.run_id, moment, view, is_flow)
        if state.activity is Activity.PAUSED:
            cache.request(key, measure)
        found = cache.result_for(key)
        return None if isinstance(found, Exception) else found


def flow_scale(found: FaceResiduals | None, page_state: PageState, mesh: Mesh, vertices: np.ndarray) -> float:
    """Length of the arrows of the flow, in lengths of the flow: as chosen, or one that fits the mesh.

    Args:
        found: the flow shown; None while it is computed.
        vertices: (n, 3) float: positions, world units.
    """
    if page_state.flow_scale:
        return float(page_state.flow_scale)
    view = page_state.residual_view
    lengths = np.zeros(0)
    if found is not None:
        lengths = np.linalg.norm(
            found.flow[~np.isnan(found.flow_px) & (True if view is None else found.chosen(view))], axis=1
        )
    reach = float(np.quantile(lengths, LONG)) if len(lengths) else 0.0
    if reach == 0:
        return 1.0
    edges = np.linalg.norm(vertices[mesh.edges[:, 1]] - vertices[mesh.edges[:, 0]], axis=1)
    return round_scale(DRAWN_REACH * float(np.median(edges)) / reach)
