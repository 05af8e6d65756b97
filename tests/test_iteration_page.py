"""The iteration page shows the step that the engine makes, part by part, with the paper's own lines."""

import re

import numpy as np
import pytest

from app.debugger.iteration_query import IterationQuery, iteration_facts
from app.page_state.cells_state import PARTS, CellsView
from app.page_state.page_state import PageState
from app.panels.iteration_page import iteration_page
from app.pictures.paper_code import CODE, Excerpt
from fairing import paper
from fairing.run.session import Session
from tests.small_scene import corner_scene, small_options


class Controls:
    """Stands in for the controls of a browser: the JavaScript is not looked at."""

    def __getattr__(self, name):
        return lambda *arguments: f"{name}({', '.join(map(str, arguments))})"


def page(session: Session, part: str, moment: int, vertex: int = 0, face: int = 2) -> str:
    facts = iteration_facts(session, IterationQuery(0, moment, face, vertex))
    state = PageState(cells=CellsView(page="iteration", part=part))
    return iteration_page(facts, session.options, state, session.scene, Controls(), lambda n: f"enter({n})")


@pytest.fixture(scope="module")
def session() -> Session:
    session = Session(corner_scene(), small_options())
    for _ in range(5):
        session.step()
    return session


def test_every_part_has_its_code_and_the_code_is_of_the_paper():
    assert list(CODE) == list(PARTS)
    source = open(paper.__file__, encoding="utf-8").read()  # noqa: SIM115
    for part, excerpts in CODE.items():
        for excerpt in excerpts:
            lines = excerpt.lines
            assert lines, part
            assert all(line.strip() in source for line in lines)
            assert '"""' not in "".join(lines), "docstrings are left out"


def test_a_line_that_the_paper_no_longer_has_is_refused():
    excerpt = Excerpt(paper.solve, first="U = ")
    with pytest.raises(ValueError, match=r"solve: no line begins with 'U = '"):
        _ = excerpt.lines


@pytest.mark.compiled
def test_every_part_is_shown_at_every_moment(session: Session):
    for moment in range(len(session.trace) + 1):
        for k, part in enumerate(PARTS):
            shown = page(session, part, moment)
            assert f"{k + 1} of {len(PARTS)} · {PARTS[part]}" in shown
            assert "In the engine" in shown
            assert "nan" not in re.sub(r"base64,[^']*", "", shown)


@pytest.mark.compiled
def test_a_step_that_is_not_made_yet_is_tried_and_not_recorded(session: Session):
    length = len(session.trace)
    assert "tried here only" in page(session, "accept", length)
    assert len(session.trace) == length
    assert f"recorded, to moment {length}" in page(session, "accept", length - 1)


@pytest.mark.compiled
def test_the_steps_shown_are_those_recorded(session: Session):
    for moment, record in enumerate(session.trace.steps):
        step = iteration_facts(session, IterationQuery(0, moment, 2, 0)).step
        slot = record.vertices.tolist().index(0)
        assert (step.steps[0] == record.proposed[slot]).all()
        assert step.steps_px[-1] == pytest.approx(record.step_px[slot], rel=1e-12)
        assert step.normal_matrix == pytest.approx(step.normal_matrix.T, rel=1e-9)
        photos = np.linalg.eigvalsh(step.hessians["photos"])
        assert photos == pytest.approx(record.eigenvalues[slot], rel=1e-9)


@pytest.mark.compiled
def test_a_finished_run_shows_its_last_step_and_a_locked_vertex_has_none():
    session = Session(
        corner_scene(), small_options(locked_vertices=(1,), schedule={"max_sweeps": [1], "max_iterations": [1]})
    )
    session.run()
    length = len(session.trace)
    facts = iteration_facts(session, IterationQuery(0, length, 2, 0))
    assert facts.moment == length - 1
    assert facts.is_recorded
    assert iteration_facts(session, IterationQuery(0, length, 0, 1)).step is None
    assert "makes no Gauss-Newton step of this vertex" in page(session, "solve", length, vertex=1, face=0)


@pytest.mark.compiled
def test_the_preset_of_the_paper_is_as_in_the_paper():
    session = Session(corner_scene(), small_options("paper"))
    session.step()
    for part in ("warp", "eigenspace", "residual", "weights", "jacobian", "normal", "solve"):
        assert "As in the paper" in page(session, part, 1), part


def test_parts_follow_each_other_and_end():
    view, seen = CellsView(), []
    while view is not None:
        seen.append(view.part)
        view = view.at_part(1)
    assert seen == list(PARTS)
    assert CellsView().at_part(-1) is None
