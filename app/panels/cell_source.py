"""Cell source: queries the engine for the cells that the cells panel and its lens show."""

from app.debugger.cell_queries import CellFacts, CellQuery, cell_facts
from app.debugger.controller import Controller
from app.debugger.run_state import Activity, RunState
from app.page_state.cells_state import ARROW_KINDS
from app.page_state.page_state import PageState
from app.query_cache import QueryCache
from fairing.mesh import Mesh


def chosen_face(mesh: Mesh, page_state: PageState) -> int | None:
    """The face whose cells are shown: the chosen one if it has the selected vertex, else the first of its one-ring."""
    if page_state.selected is None:
        return None
    faces = mesh.one_rings[page_state.selected].tolist()
    if not faces:
        return None
    return page_state.face if page_state.face is not None and page_state.face in faces else faces[0]


class CellSource:
    """The cells of one browser. Queries are posted while the run is paused, when face, moment or settings change."""

    def __init__(self, controller: Controller, mesh: Mesh) -> None:
        self._mesh = mesh
        self._lookup: QueryCache[CellQuery, CellFacts] = QueryCache(controller.query)

    def want(self, state: RunState, page_state: PageState) -> None:
        """Query the cells of the current face and moment, if the run is paused."""
        question = self._question(state, page_state)
        if question is not None and state.activity is Activity.PAUSED:
            self._lookup.request(question, lambda session: cell_facts(session, question))

    def newest(self, state: RunState, page_state: PageState) -> tuple[CellQuery, CellFacts | Exception] | None:
        """The latest cells of the current face, possibly of an earlier moment; None if there are none yet."""
        found, question = self._lookup.latest, self._question(state, page_state)
        if found is None or question is None:
            return None
        same = (found[0].run_id, found[0].face, found[0].vertex) == (question.run_id, question.face, question.vertex)
        return found if same else None

    def _question(self, state: RunState, page_state: PageState) -> CellQuery | None:
        face = chosen_face(self._mesh, page_state)
        if face is None or page_state.selected is None:
            return None
        shows_arrows = page_state.cells.in_lens is not None and page_state.cells.in_lens[1] in ARROW_KINDS
        with_flows = shows_arrows or any(kind in ARROW_KINDS for kind in page_state.cells.columns)
        return CellQuery(state.run_id, state.moment, face, page_state.selected, page_state.cells.dimensions, with_flows)
