"""Association source: what the terms measure the mesh against, computed while the engine is paused and a layer shows it."""

from dataclasses import dataclass
from typing import Any

from app.debugger.controller import Controller
from app.debugger.run_state import Activity, RunState
from app.page_state.page_state import PageState
from app.query_cache import QueryCache
from fairing.judge.associations import axis_edges, image_edges, point_feet, seen_faces
from fairing.run.session import Session

OF_PHOTO = ("image edges", "seen")
"""Layers that show the associations of the photo whose camera is entered."""


@dataclass(frozen=True)
class AssociationKey:
    """The mesh at a moment of a run; and the photo, None for associations that are of all photos."""

    run_id: int
    moment: int
    view: int | None


class AssociationSource:
    """The associations that one browser shows, by layer."""

    def __init__(self, controller: Controller) -> None:
        self._caches: dict[str, QueryCache[AssociationKey, Any]] = {
            layer: QueryCache(controller.query) for layer in ("point feet", "image edges", "axes", "seen")
        }

    def shown(self, layer: str, state: RunState, page_state: PageState) -> Any:
        """The associations of a layer; None if it is hidden, nothing is known yet or the mesh moves."""
        view = page_state.entered if layer in OF_PHOTO else None
        if not page_state.shows(layer) or state.is_moving or (layer in OF_PHOTO and view is None):
            return None
        key, cache = AssociationKey(state.run_id, state.moment, view), self._caches[layer]
        if state.activity is Activity.PAUSED:
            cache.request(key, lambda session: _compute(layer, session, key))
        found = cache.result_for(key)
        return None if isinstance(found, Exception) else found


def _compute(layer: str, session: Session, key: AssociationKey) -> Any:
    if layer == "point feet":
        return point_feet(session, key.moment)
    if layer == "axes":
        return axis_edges(session, key.moment)
    if layer == "seen":
        return seen_faces(session, key.moment)
    assert key.view is not None
    return image_edges(session, key.moment, key.view)
