"""Residual source: residuals by face or sample, and image flow, computed while the engine is paused and they are shown."""

import numpy as np

from app.debugger.controller import Controller
from app.debugger.run_state import Activity, RunState
from app.page_state.page_state import PageState
from app.page_state.pull_source import DRAWN_REACH, round_scale
from app.query_cache import QueryCache
from fairing.judge.face_residuals import FaceResiduals, face_residuals
from fairing.judge.texel_residuals import TexelResiduals, texel_residuals
from fairing.mesh import Mesh

LONG = 0.9  # quantile of the lengths of arrows that may reach as far as `DRAWN_REACH`


class ResidualSource:
    """The residuals that one browser shows: by face for all photos at once, so that another photo needs no new computation."""

    def __init__(self, controller: Controller) -> None:
        self._cache: QueryCache[tuple[int, int, bool], FaceResiduals] = QueryCache(controller.query)
        self._texels: QueryCache[tuple[int, int, int | None], TexelResiduals] = QueryCache(controller.query)
        self._start_texels: QueryCache[tuple[int, int, int | None], TexelResiduals] = QueryCache(controller.query)

    def at(self, state: RunState, page_state: PageState) -> FaceResiduals | None:
        """The residuals at the moment shown; None while they are computed, or if they cannot be."""
        with_flow, moment = page_state.surface == "flow", state.moment
        key = (state.run_id, moment, with_flow)
        is_shown = with_flow or (page_state.surface == "residual" and not page_state.is_per_pixel)
        if is_shown and state.activity is Activity.PAUSED:
            self._cache.request(key, lambda session: face_residuals(session, moment, with_flow=with_flow))
        found = self._cache.result_for(key)
        return None if isinstance(found, Exception) else found

    def texels_at(self, state: RunState, view: int | None, *, at_start: bool = False) -> TexelResiduals | None:
        """The residuals at every sample in a photo, or over all, at the moment shown or the start; None while they are computed,
        or if they cannot be."""
        cache, moment = (self._start_texels, 0) if at_start else (self._texels, state.moment)
        key = (state.run_id, moment, view)
        if state.activity is Activity.PAUSED:
            cache.request(key, lambda session: texel_residuals(session, moment, view))
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
