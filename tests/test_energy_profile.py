"""Energy profile: energies around a vertex, against the cells' own energies and the gradient; when it is not computed."""

import json
from html import unescape
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from app.debugger.energy_profile import POSITIONS, REACH, EnergyProfile, energy_profile, reach_at
from app.debugger.run_state import Activity
from app.page_state.page_state import PageState
from app.page_state.selection import Selection
from app.panels.profile_panel import ProfilePanel
from demo_scenes import load_demo
from fairing.errors import Cancelled
from fairing.judge.inspect import face_cells
from fairing.run.session import Session

VERTEX = 0


@pytest.fixture(scope="module")
def session() -> Session:
    return Session(load_demo("cube"))


def ring(session: Session) -> list[int]:
    return session.scene.mesh.one_rings[VERTEX].tolist()


def profile(session: Session, reach: float, **settings: Any) -> EnergyProfile | None:
    return energy_profile(session, VERTEX, 0, reach, **settings)


def test_where_the_vertex_is_the_energy_is_that_of_its_cells(session: Session):
    found = profile(session, 0.1)
    assert found is not None
    middle = POSITIONS // 2
    expected = sum(face_cells(session, face, 0).view_energy.sum() for face in ring(session))
    assert found.offsets[[0, middle, -1]].tolist() == pytest.approx([-0.1, 0, 0.1])
    assert found.lines[:, middle] == pytest.approx(np.full(3, expected), rel=1e-9)
    assert np.ptp(found.lines, axis=1).min() > 0.01 * expected


def test_it_falls_against_the_gradient(session: Session):
    found, faces = profile(session, 1e-4), ring(session)
    assert found is not None
    slopes = (found.lines[:, -1] - found.lines[:, 0]) / np.ptp(found.offsets)
    system, corners = session.linearise_by_photos(np.array(faces), 0), session.scene.mesh.faces[faces]
    gradient = system.g.reshape(-1, 3, 3)[corners == VERTEX].sum(axis=0)
    cosine = slopes @ gradient / np.linalg.norm(slopes) / np.linalg.norm(gradient)
    assert cosine > 0.98  # the gradient neglects how the eigenspace and the sampling change
    assert 0.7 < np.linalg.norm(slopes) / np.linalg.norm(gradient) < 1.3


def test_the_vertex_moves_by_a_share_of_its_shortest_edge():
    vertices = np.array([[0.0, 0, 0], [2, 0, 0], [0, 3, 0], [0.1, 0, 0]])
    assert reach_at(vertices, np.array([[0, 1, 2]]), 0) == pytest.approx(2 * REACH)


def test_it_ends_where_it_is_not_wanted_or_a_command_waits(session: Session):
    answers = iter([True, True, False])
    assert profile(session, 0.1, is_wanted=lambda: next(answers)) is None
    assert next(answers, "all asked") == "all asked"
    session.sweep_state(0)
    session.cancel_requested = lambda: True
    try:
        with pytest.raises(Cancelled):
            profile(session, 0.1)
    finally:
        session.cancel_requested = lambda: False


class Queries:
    """A controller whose queries are computed on demand."""

    def __init__(self, session: Session) -> None:
        self._session, self.waiting = session, []

    def query(self, key: object, compute: Any, callback: Any) -> None:
        self.waiting.append((compute, callback))

    def compute(self) -> list[Any]:
        waiting, self.waiting = self.waiting, []
        results = [compute(self._session) for compute, _ in waiting]
        for result, (_, callback) in zip(results, waiting, strict=True):
            callback(result)
        return results


@pytest.fixture
def shown(session: Session) -> Any:
    """A panel, its queries and its content; `select` shows a selection."""
    queries, handle = Queries(session), SimpleNamespace(content="")
    gui: Any = SimpleNamespace(add_html=lambda content: handle)
    panel = ProfilePanel(gui, session.scene.mesh, queries)  # pyright: ignore[reportArgumentType]

    def select(vertices: tuple[int, ...], moment: int = 0, activity: Activity = Activity.PAUSED) -> str:
        state: Any = SimpleNamespace(run_id=1, moment=moment, activity=activity, vertices=session.scene.mesh.vertices)
        panel.show(state, PageState(Selection(vertices)))
        return handle.content

    return SimpleNamespace(select=select, queries=queries)


def drawn(html: str) -> dict[str, Any]:
    return json.loads(unescape(html.split('data="')[1].split('"')[0]))


def test_the_panel_draws_the_profile_of_the_selected_vertex(session: Session, shown: Any):
    assert "<h4>" not in shown.select(())
    assert "Computing…" in shown.select((2, VERTEX))
    shown.queries.compute()
    data = drawn(shown.select((2, VERTEX)))
    mesh = session.scene.mesh
    expected = profile(session, reach_at(mesh.vertices, mesh.faces[ring(session)], VERTEX))
    assert expected is not None
    assert (data["vertex"], data["offsets"], data["lines"]) == (
        VERTEX,
        expected.offsets.tolist(),
        expected.lines.tolist(),
    )
    assert "at moment 0" in shown.select((VERTEX,), moment=3, activity=Activity.RUNNING)
    assert not shown.queries.waiting, "nothing is computed while the run moves"


def test_a_new_selection_ends_the_computation_of_the_one_before(shown: Any):
    shown.select((VERTEX,))
    shown.select((3,))
    first, second = shown.queries.compute()
    assert first is None
    assert second is not None
    assert drawn(shown.select((3,)))["vertex"] == 3
    shown.select((VERTEX,))
    assert "<h4>" not in shown.select(())
    assert shown.queries.compute() == [None]
    assert "Computing…" in shown.select((VERTEX,)), "selected again, it is computed again"
    assert len(shown.queries.waiting) == 1
