"""The cells that the panel and its lens show, asked of the engine whenever it rests and something else is looked at."""

from app.debugger.cell_queries import CellFacts, CellQuestion, cell_facts
from app.debugger.commands import Query
from app.debugger.controller import Controller
from app.debugger.run_state import Activity, RunState
from app.page_state.cells_state import ARROW_KINDS
from app.page_state.page_state import PageState
from app.query_cache import QueryCache
from fairing.mesh import Mesh


def chosen_face(mesh: Mesh, page_state: PageState) -> int | None:
    """The face looked at: the one chosen if it has the selected vertex, else that vertex' first."""
    if page_state.selected is None:
        return None
    faces = mesh.one_rings[page_state.selected].tolist()
    if not faces:
        return None
    return page_state.face if page_state.face is not None and page_state.face in faces else faces[0]


class CellSource:
    """Of one browser."""

    def __init__(self, controller: Controller, mesh: Mesh) -> None:
        self._mesh = mesh
        self._lookup: QueryCache[CellQuestion, CellFacts] = QueryCache(
            lambda asker, work, answer: controller.post(Query(asker, work, answer))
        )

    def want(self, state: RunState, page_state: PageState) -> None:
        """Query if it is time."""
        question = self._question(state, page_state)
        if question is not None and state.activity is Activity.PAUSED:
            self._lookup.want(question, lambda session: cell_facts(session, question))

    def newest(self, state: RunState, page_state: PageState) -> tuple[CellQuestion, CellFacts | Exception] | None:
        """What is known of the face looked at; a moment that has just gone serves until the next is there."""
        found, question = self._lookup.newest, self._question(state, page_state)
        if found is None or question is None:
            return None
        same = (found[0].run_id, found[0].face, found[0].vertex) == (question.run_id, question.face, question.vertex)
        return found if same else None

    def _question(self, state: RunState, page_state: PageState) -> CellQuestion | None:
        face = chosen_face(self._mesh, page_state)
        if face is None or page_state.selected is None:
            return None
        looks_at_arrows = page_state.cells.in_lens is not None and page_state.cells.in_lens[1] in ARROW_KINDS
        with_flows = looks_at_arrows or any(kind in ARROW_KINDS for kind in page_state.cells.columns)
        return CellQuestion(
            state.run_id, state.moment, face, page_state.selected, page_state.cells.dimensions, with_flows
        )
