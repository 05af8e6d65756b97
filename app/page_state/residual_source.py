"""Residual source: residuals and image flow of all faces, computed while the engine is paused and they are shown."""

from app.debugger.controller import Controller
from app.debugger.run_state import Activity, RunState
from app.page_state.page_state import PageState
from app.query_cache import QueryCache
from fairing.judge.face_residuals import FaceResiduals, face_residuals


class ResidualSource:
    """The residuals that one browser shows, for all photos at once: another photo needs no new computation."""

    def __init__(self, controller: Controller) -> None:
        self._cache: QueryCache[tuple[int, int, bool], FaceResiduals] = QueryCache(controller.query)

    def at(self, state: RunState, page_state: PageState) -> FaceResiduals | None:
        """The residuals at the moment shown; None while they are computed, or if they cannot be."""
        with_flow, moment = page_state.surface == "flow", state.moment
        key = (state.run_id, moment, with_flow)
        if page_state.surface in ("residual", "flow") and state.activity is Activity.PAUSED:
            self._cache.request(key, lambda session: face_residuals(session, moment, with_flow=with_flow))
        found = self._cache.result_for(key)
        return None if isinstance(found, Exception) else found
