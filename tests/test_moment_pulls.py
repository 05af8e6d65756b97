"""Pulls in conditions, watches, tables, colours and arrows, against the session's own."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from app.debugger.commands import JumpTo, Run
from app.debugger.controller import Controller
from app.debugger.moment_pulls import moment_pulls, term_word
from app.debugger.quantities import StepContext, limits_of, parse_step_condition, quantities_of
from app.debugger.watch import needs_pulls, parse_watch, value_with_pulls
from app.layers.pull_arrows import arrow_lines, pull_lines
from app.page_state.page_state import PageState
from app.page_state.pull_source import DRAWN_REACH, PullSource, arrow_scale
from app.page_state.selection import Selection
from app.palette import GROUND, SELECTED, TERM_COLORS, solid
from app.panels.breakpoints_panel import ready_made
from app.panels.condition_field import words_for
from app.panels.legend import legend_html, pull_arrows_html
from app.panels.pulls_panel import pulls_html
from app.pictures.coloring import COLORINGS, color_mesh
from app.pictures.term_colors import COLOR_OF_TERM
from fairing.errors import InputError
from fairing.options import FairingOptions
from fairing.run.pulls import shares
from fairing.run.session import Session
from fairing.scene import Scene
from fairing.terms.names import TERMS
from tests.color_vision import BLINDNESS, in_cielab
from tests.small_scene import FACES, VERTICES, corner_scene, on_the_faces, small_options, sparse_points
from tests.waiting import wait_for


@pytest.fixture(scope="module")
def scene() -> Scene:
    return replace(corner_scene(), sparse_points=sparse_points(np.repeat(on_the_faces(), 2, axis=0)))


@pytest.fixture(scope="module")
def options() -> FairingOptions:
    step = {"points": [0.3], "creases": [0.0, 1.0, 1.0]}
    return small_options(schedule={"order": "joint", "max_sweeps": [2], "max_iterations": [3]}, step=step)


@pytest.fixture(scope="module")
def session(scene: Scene, options: FairingOptions) -> Session:
    session = Session(scene, options)
    session.run()
    return session


def with_points(session: Session) -> int:
    """A moment at which points and image edges pull."""
    names = {"points", "image edges"}
    return next(m for m in range(1, len(session.trace)) if names <= {pull.name for pull in session.pulls(m)})


def test_conditions_read_the_pulls_at_the_moment_after_the_step(session: Session):
    moment = with_points(session)
    session.go_to(moment)
    ask = quantities_of(session.trace.steps[moment - 1], moment, StepContext(session, session.trace.start))

    def value(text: str) -> float:
        return parse_watch(text, session.scene).evaluate(ask)

    pulls = {pull.name: pull for pull in session.pulls(moment)}
    for name in TERMS:
        word = term_word(name)
        px = pulls[name].step_px if name in pulls else np.zeros(len(VERTICES))
        assert value(f"pull({word})") == px.max()
        for vertex in range(len(VERTICES)):
            assert value(f"pull({word}, {vertex})") == px[vertex]
    for share, name in zip(shares(session.pulls(moment)), pulls, strict=True):
        assert value(f"share({name.replace(' ', '_')}, 0)") == pytest.approx(share[0])
    assert sum(value(f"share({term_word(name)})") for name in TERMS) == pytest.approx(1)
    assert np.isnan(value("pull(photos, 2 + 99)"))


def test_a_run_stops_where_a_pull_exceeds_a_limit(scene: Scene, options: FairingOptions, session: Session):
    moments = range(1, len(session.trace) + 1)
    found = [{pull.name: pull.step_px.max() for pull in session.pulls(moment)} for moment in moments]
    px = [pulls.get("photos", np.nan) for pulls in found]  # fits have no photos
    limit = float(np.nanmedian(px))
    controller = Controller(Session(scene, options))
    try:
        controller.edit_breakpoints(lambda b: b.added(f"pull(photos) > {limit:.9f}"))
        controller.post(Run())
        state = controller.wait_until_idle()
        assert state.reason.startswith("breakpoint: pull(photos)")
        assert state.moment == next(k for k, value in enumerate(px, 1) if value > limit)
    finally:
        controller.close()


def test_pulls_are_unknown_without_an_engine_and_known_from_pulls_alone(session: Session):
    watch, moment = parse_watch("pull(points) + share(photos)", session.scene), with_points(session)
    record, found = session.trace.steps[moment - 1], moment_pulls(session, moment)
    assert needs_pulls(watch)
    assert not needs_pulls(parse_watch("energy", session.scene))
    assert np.isnan(watch.evaluate(quantities_of(record, moment)))
    expected = found.px_of("points").max() + found.shares_of_all[0]
    assert value_with_pulls(watch, record, moment, found) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("text", "mistake"),
    [
        ("pull(0) > 1", r"column 6: pull\(\) expects a term: photos, points"),
        ("pull(edges) > 1", r"column 6: pull\(\) expects a term"),
        ("share(photos, 7) < 0.2", r"column 15: share\(\) expects a whole number from 0 to 6"),
        ("pull(photos 3) > 1", r"column 13: expected \)"),
        ("about(1, 2)", r"column 8: expected \)"),
        ("pull(photos,) > 1", r"column 13: expected a number or a name"),
    ],
)
def test_a_mistake_in_a_term_is_shown_at_its_place(scene: Scene, text: str, mistake: str):
    with pytest.raises(InputError, match=mistake):
        parse_step_condition(text, limits_of(scene))


def test_terms_are_offered_and_what_is_offered_is_understood(scene: Scene):
    words = dict(words_for(PageState(Selection((3,))), TERMS))
    assert set(map(term_word, TERMS)) <= set(words)
    assert {"pull(photos, 3)", "share(photos, 3)"} <= set(words)
    parse_step_condition("pull(photos, 3) > 1 and share(image_edges) < 0.2", limits_of(scene))
    for condition in ready_made(PageState(Selection((3,)))).values():
        parse_step_condition(condition, limits_of(scene))


def test_the_source_computes_each_moment_once_and_says_which_one_is_the_latest(scene: Scene, options: FairingOptions):
    controller = Controller(Session(scene, options))
    try:
        controller.post(Run())
        controller.wait_until_idle()
        source, computed = PullSource(controller), []
        for moment in (3, 3, 4):
            controller.post(JumpTo(moment))
            state = controller.wait_until_idle()
            wait_for(lambda state=state: source.at(state) is not None)
            computed.append(source.at(state))
            assert source.latest(state) == (moment, computed[-1])
        assert computed[0] is computed[1]
        assert computed[2] is not computed[1]
    finally:
        controller.close()


def test_the_table_has_a_row_for_every_term_and_the_whole_step(session: Session):
    found = moment_pulls(session, with_points(session))
    shown = pulls_html(found, 0, "", is_over=False)
    for pull in found.pulls:
        assert f"{solid(COLOR_OF_TERM[pull.name])}'></i>{pull.name}<" in shown
    assert shown.count("<tr") == len(found.pulls) + 2
    assert "Pulls on the next step<" in shown
    assert "one more step" in pulls_html(found, 0, "", is_over=True)


def test_arrows_lie_head_to_tail_and_end_where_the_step_ends(session: Session):
    found, place = moment_pulls(session, with_points(session)), np.array([5.0, -1.0, 2.0])
    lines, colors = pull_lines(found, 0, place, 50.0)
    shafts, names = lines[::3], [pull.name for pull in found.pulls]
    assert shafts[0] == pytest.approx(np.array([place, place + 50 * found.step[0]]), abs=1e-9)
    assert tuple(colors[0]) == SELECTED
    by_color = {COLOR_OF_TERM[name]: name for name in names}
    drawn = [by_color[tuple(color)] for color in colors[3::3].tolist()]
    assert drawn == [name for name in names if name in drawn], "in the order of the terms"
    longest = max(float(np.linalg.norm(pull.step[0])) for pull in found.pulls)
    # Negligible parts are left out: the ends meet but for them.
    for before, after in itertools.pairwise(shafts[1:]):
        assert after[0] == pytest.approx(before[1], abs=50 * 0.005 * len(names) * longest)
    assert shafts[-1][1] == pytest.approx(shafts[0][1], abs=50 * 0.005 * len(names) * longest)


def test_a_head_is_attached_to_the_tip_and_symmetric():
    tails, tips = np.zeros((2, 3)), np.array([[2.0, 0, 0], [0, 0, -8.0]])
    lines = arrow_lines(tails, tips, 1.0).reshape(2, 3, 2, 3)
    for arrow, tip, head in zip(lines, tips, (0.5, 1.0), strict=True):
        assert arrow[1:, 0] == pytest.approx(np.array([tip, tip]))
        back = (tip - arrow[1:, 1]) @ tip / np.linalg.norm(tip)
        assert back == pytest.approx(head)
        assert arrow[1:, 1].mean(axis=0) == pytest.approx(tip - head * tip / np.linalg.norm(tip))


def test_a_vertex_without_a_step_has_no_arrows():
    session = Session(corner_scene(), small_options(locked_vertices=(3,)))
    lines, colors = pull_lines(moment_pulls(session, 0), 3, VERTICES[3], 10.0)
    assert len(lines) == len(colors) == 0


def test_the_automatic_length_of_arrows_fits_the_mesh(session: Session):
    moment = with_points(session)
    found, vertices = moment_pulls(session, moment), session.trace.vertices_at(moment)
    page_state = PageState(Selection((0,)))
    scale = arrow_scale(found, page_state, session.scene.mesh, vertices)
    assert f"{scale:g}".strip("0") in ("1", "2", "5") or scale == 1
    edge = np.linalg.norm(vertices[1:] - vertices[0], axis=1).mean()
    reach = scale * np.linalg.norm(np.cumsum([pull.step[0] for pull in found.pulls], axis=0), axis=1).max()
    assert DRAWN_REACH / 2.6 * edge < reach <= DRAWN_REACH * edge or scale == 1
    page_state.pull_scale = 100
    assert arrow_scale(found, page_state, session.scene.mesh, vertices) == 100
    assert "next step ×100" in pull_arrows_html(found, page_state, 100.0)


def test_the_surface_shows_the_strongest_term_and_one_term_s_pull(session: Session):
    moment = with_points(session)
    found = moment_pulls(session, moment)
    strongest, names = COLORINGS["strongest"].values(session, moment), list(TERMS)
    for v in range(len(VERTICES)):
        lengths = {pull.name: np.linalg.norm(pull.step[v]) for pull in found.pulls}
        best = max(lengths, key=lambda name: lengths[name])
        assert (names[int(strongest[v])] == best) if lengths[best] > 0 else np.isnan(strongest[v])
    mesh = color_mesh(COLORINGS["strongest"], strongest, VERTICES, FACES)
    shown = legend_html(mesh.legend)
    for k in np.unique(strongest[~np.isnan(strongest)]):
        assert names[int(k)] in shown
    of_pulls = COLORINGS["pull"].of_pulls
    assert of_pulls is not None
    assert np.array_equal(of_pulls(found, "points"), found.px_of("points"))


@pytest.mark.parametrize("blindness", BLINDNESS)
def test_colours_of_terms_differ_with_any_colour_vision_and_from_both_grounds(blindness: str):
    colors = in_cielab(np.array([*TERM_COLORS, *GROUND], dtype=float), blindness)
    apart = np.linalg.norm(colors[:, None] - colors, axis=-1)
    terms = len(TERM_COLORS)
    for a, b in itertools.combinations(range(terms), 2):
        assert apart[a, b] > 25, (a, b)
    if blindness == "normal":
        assert apart[:terms, terms:].min() > 40
