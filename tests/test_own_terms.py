"""Terms of one's own: against differences and a dense solve, and how their mistakes are told."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import approx_fprime

import fairing
from app.debugger.moment_pulls import moment_pulls
from app.debugger.quantities import StepContext, parse_step_condition, quantities_of
from app.page_state.page_state import PageState
from app.palette import OWN_TERM_COLORS
from app.panels.condition_field import words_for
from app.pictures.coloring import COLORINGS
from app.pictures.term_colors import colors_of_terms
from fairing.errors import InputError
from fairing.optimize.loss import GemanMcClure
from fairing.run.recorded_terms import term_meanings
from fairing.run.session import Session
from fairing.terms.names import TERMS
from fairing.terms.own import OwnRows, OwnTerm, Residuals, begun
from fairing.trace import Trace
from tests.small_scene import VERTICES, corner_scene, small_options

PAIRS = np.array([[0, 1, 2, 3], [0, 2, 3, 4], [0, 3, 4, 5]])


class Planarity(OwnTerm):
    """Faces that do not lie in one plane.

    The second line is not shown.
    """

    name = "planarity"

    def begin(self, scene: fairing.Scene, vertices: np.ndarray) -> Residuals:
        def residual(places: np.ndarray) -> np.ndarray:
            a, b, c, d = places[PAIRS].transpose(1, 0, 2)
            normal = np.cross(b - a, c - a)
            return ((d - a) * normal).sum(axis=1) / np.linalg.norm(normal, axis=1)

        return Residuals(PAIRS, residual, GemanMcClure(0.05))


class Pinned(OwnTerm):
    """Distance of a vertex from a place."""

    name = "pinned"
    strength = 1e6

    def begin(self, scene: fairing.Scene, vertices: np.ndarray) -> Residuals:
        return Residuals(np.zeros((3, 1), dtype=int), lambda places: places[0] - [1.02, 0.99, 1.01])


class Failing(OwnTerm):
    """Divides by zero."""

    name = "failing"

    def begin(self, scene: fairing.Scene, vertices: np.ndarray) -> Residuals:
        return Residuals(PAIRS, lambda places: np.full(3, 1 // 0))


def rows(term: OwnTerm, vertices: np.ndarray) -> OwnRows:
    found = begun(term, corner_scene(), vertices, np.ones(len(vertices), dtype=bool), 5.0)
    assert found is not None
    return found


def test_the_gradient_and_the_normal_matrix_are_those_of_the_energy():
    vertices = VERTICES + np.random.default_rng(0).normal(size=VERTICES.shape) * 0.03
    found = rows(Planarity(), vertices)
    linear = found.linearise(vertices)
    energy = lambda x: found.total(x.reshape(-1, 3))  # noqa: E731
    assert linear.gradient.ravel() == pytest.approx(approx_fprime(vertices.ravel(), energy, 1e-7), rel=1e-3, abs=1e-4)
    residuals = lambda x: found.residual(x.reshape(-1, 3))  # noqa: E731
    J = approx_fprime(vertices.ravel(), residuals, 1e-8)
    weights = found.information * found.loss.weight(residuals(vertices))
    assert linear.matrix.toarray() == pytest.approx(J.T * weights @ J, rel=1e-4, abs=1e-3)
    blocks = [linear.matrix.toarray()[3 * v : 3 * v + 3, 3 * v : 3 * v + 3] for v in range(len(vertices))]
    assert found.hessians(vertices) == pytest.approx(np.array(blocks))
    assert found.by_vertex(vertices).sum() == pytest.approx(4 * found.total(vertices))
    assert found.around(np.array([1])).total(vertices) == pytest.approx(
        sum(found.information * found.loss.value(residuals(vertices))[:1])
    )


def test_the_strength_is_relative_to_the_photos():
    diagonal = np.einsum("vii->vi", rows(Planarity(), VERTICES).hessians(VERTICES))
    assert diagonal[diagonal > 0].mean() == pytest.approx(0.3 * 5.0)
    weak = Planarity()
    weak.strength = 0.0
    assert begun(weak, corner_scene(), VERTICES, np.ones(len(VERTICES), dtype=bool), 5.0) is None


@pytest.mark.compiled
@pytest.mark.parametrize("order", ["joint", "sequential"])
def test_a_strong_term_wins_and_its_pull_is_part_of_the_step(order: str):
    options = small_options(schedule={"order": order})
    session = Session(corner_scene((0.03, -0.03, 0.02)), options, terms=[Pinned()])
    session.make_plan()
    pulls = {pull.name: pull for pull in session.pulls()}
    assert pulls["pinned"].step[1:] == pytest.approx(0 if order == "sequential" else pulls["pinned"].step[1:])
    before = np.linalg.norm(session.vertices[0] - [1.02, 0.99, 1.01])
    assert before > 0.02
    session.run()
    assert np.linalg.norm(session.vertices[0] - [1.02, 0.99, 1.01]) < 1e-3
    assert term_meanings(session.trace) == TERMS | {"pinned": "Distance of a vertex from a place."}


class Elsewhere(Pinned):
    """Distance of a vertex from another place."""


@pytest.mark.compiled
def test_sessions_with_terms_of_the_same_name_do_not_see_each_other():
    sessions = [Session(corner_scene(), small_options(), terms=[term]) for term in (Pinned(), Elsewhere(), Planarity())]
    meanings = [moment_pulls(session, 0).meanings for session in sessions]
    assert meanings[0]["pinned"] == "Distance of a vertex from a place."
    assert meanings[1]["pinned"] == "Distance of a vertex from another place."
    assert "pinned" not in meanings[2]
    words = [dict(words_for(PageState(), of_session)) for of_session in meanings]
    assert [each.get("pinned", "").removeprefix("term: ") for each in words] == [m.get("pinned", "") for m in meanings]


@pytest.mark.compiled
def test_numbers_and_colours_of_terms_are_those_of_the_run_whatever_ran_before():
    for term in (Pinned(), Planarity(), Elsewhere()):
        found = moment_pulls(Session(corner_scene(), small_options(), terms=[term]), 0)
        assert [pull.name for pull in found.pulls][-1] == term.name
        assert colors_of_terms(found.meanings)[term.name] == OWN_TERM_COLORS[0]
        *_, (number, name, color) = COLORINGS["strongest"].categories(found.meanings)
        assert (name, color) == (term.name, OWN_TERM_COLORS[0])
        if term.strength > 1:
            assert found.strongest()[0] == number


@pytest.mark.compiled
def test_a_condition_on_a_term_holds_on_to_its_name_in_other_runs():
    alone, both, without = (
        Session(corner_scene(), small_options(), terms=terms)
        for terms in ([Planarity()], [Pinned(), Planarity()], [Pinned()])
    )
    condition = parse_step_condition("pull(planarity, 2) > 0", terms=term_meanings(alone.trace))
    for session, pulls in ((alone, True), (both, True), (without, False)):
        record = session.step()
        assert record is not None
        context = StepContext(session, session.trace.start)
        assert condition.holds(quantities_of(record, 1, context)) == pulls


@pytest.mark.compiled
def test_mistakes_in_a_term_are_told_with_file_and_line():
    with pytest.raises(
        InputError, match=r"term failing: residual raised ZeroDivisionError: .*test_own_terms.py, line \d+"
    ):
        fairing.fair(corner_scene(), small_options(), terms=[Failing()])


class WrongShape(Planarity):
    def begin(self, scene: fairing.Scene, vertices: np.ndarray) -> Residuals:
        return Residuals(PAIRS, lambda places: np.zeros(2))


class WrongIds(Planarity):
    def begin(self, scene: fairing.Scene, vertices: np.ndarray) -> Residuals:
        return Residuals(PAIRS + 5, lambda places: np.zeros(3))


class NoResiduals(Planarity):
    def begin(self, scene: fairing.Scene, vertices: np.ndarray) -> Residuals:
        return np.zeros(3)  # pyright: ignore[reportReturnType]


class Named(Planarity):
    def __init__(self, name: str) -> None:
        self.name = name


@pytest.mark.parametrize(
    ("term", "message"),
    [
        (WrongShape(), "expected 3 finite residuals"),
        (WrongIds(), "whole numbers from 0 to 6"),
        (NoResiduals(), "expected begin to return fairing.Residuals, found ndarray"),
    ],
)
def test_what_a_term_returns_is_checked(term: OwnTerm, message: str):
    with pytest.raises(InputError, match=message):
        begun(term, corner_scene(), VERTICES, np.ones(len(VERTICES), dtype=bool), 1.0)


@pytest.mark.parametrize(
    ("terms", "message"),
    [
        ([Named("photos")], "already"),
        ([Planarity(), Planarity()], "already"),
        ([Named("")], "expected a name of words"),
        ([Named("<b>")], "expected a name of words"),
        ([Planarity], r"found the class Planarity; write terms=\[Planarity\(\)\]"),
        (["planarity"], "found str"),
    ],
)
def test_terms_that_cannot_be_told_apart_are_refused(terms: list, message: str):
    with pytest.raises(InputError, match=message):
        Session(corner_scene(), small_options(), terms=terms)


@pytest.mark.compiled
def test_a_run_is_shown_without_its_terms_but_continued_with_the_same_alone(tmp_path):
    session = Session(corner_scene(), small_options(), terms=[Planarity()])
    session.step()
    session.trace.attach(tmp_path / "run.trace")
    trace = Trace.load(tmp_path / "run.trace")
    shown = Session(corner_scene(), trace=trace)
    assert np.array_equal(shown.vertices, session.vertices)
    assert shown.sweep_state(1).context.takes_part.any()
    with pytest.raises(InputError, match=r"own terms planarity \(.*test_own_terms.py\), found none"):
        shown.step()
    changed = Planarity()
    changed.strength = 2.0
    with pytest.raises(InputError, match="other code"):
        Session(corner_scene(), trace=trace, terms=[changed]).step()
    again = Session(corner_scene(), trace=trace, terms=[Planarity()])
    assert np.array_equal(again.step().after, session.step().after)


@pytest.mark.compiled
def test_a_branch_with_other_code_begins_its_sweep_anew():
    session = Session(corner_scene((0.03, -0.03, 0.02)), small_options(), terms=[Planarity()])
    session.step()
    branch = session.branch(terms=[Pinned()])
    assert branch.plan == session.plan
    assert [term.name for term in branch.sweep_state().terms if isinstance(term, OwnRows)] == ["pinned"]
    branch.run()
    assert np.linalg.norm(branch.vertices[0] - [1.02, 0.99, 1.01]) < 1e-3
    same = session.branch()
    assert same.sweep_state() is session.sweep_state()


@pytest.mark.parametrize("terms", [3, [3], [{"name": "x"}], [{"name": 1, "meaning": "", "file": "", "digest": ""}]])
def test_recorded_terms_that_make_no_sense_are_refused(terms: object):
    session = Session(corner_scene(), small_options())
    session.trace.header["own_terms"] = terms
    with pytest.raises(InputError, match="own_terms"):
        Session(replace(corner_scene()), trace=session.trace)
