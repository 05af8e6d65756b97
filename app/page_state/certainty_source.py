"""How well the photos determine the selected vertices, asked of the engine whenever it rests."""

from dataclasses import dataclass

import numpy as np

from app.debugger.controller import Controller
from app.debugger.run_state import Activity, RunState
from app.page_state.page_state import PageState
from app.query_cache import QueryCache
from fairing.judge.certainty import Certainty, certainties

MAX_VERTICES = 50


@dataclass(frozen=True)
class CertaintyQuestion:
    """Attributes:
    run_id, moment: where.
    vertices: ids; the current one comes last.
    """

    run_id: int
    moment: int
    vertices: tuple[int, ...]


class CertaintySource:
    """Of one browser."""

    def __init__(self, controller: Controller) -> None:
        self._lookup: QueryCache[CertaintyQuestion, list[Certainty]] = QueryCache(controller.query)

    def want(self, state: RunState, view: PageState) -> None:
        """Query if it is time."""
        question = certainty_question(state, view)
        if question is not None and state.activity is Activity.PAUSED:
            self._lookup.request(
                question, lambda session: certainties(session, np.array(question.vertices), question.moment)
            )

    def newest(self, state: RunState, view: PageState) -> list[Certainty]:
        """What is known of the vertices looked at; a moment that has just gone serves until the next is there."""
        found, question = self._lookup.latest, certainty_question(state, view)
        if found is None or question is None or isinstance(found[1], Exception):
            return []
        asked = found[0]
        return found[1] if (asked.run_id, asked.vertices) == (question.run_id, question.vertices) else []


def certainty_question(state: RunState, view: PageState) -> CertaintyQuestion | None:
    """The current vertex, and where they are drawn the others last chosen."""
    if view.selected is None:
        return None
    chosen = view.selection.vertices[-MAX_VERTICES:] if view.shows("certainty") else (view.selected,)
    return CertaintyQuestion(state.run_id, state.moment, chosen)
