"""Lessons claim nothing that the engine does not show, and their player never takes the run out of a user's hands."""

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from app.debugger.commands import DeleteRun, JumpTo, Pause, Restart, Run
from app.debugger.controller import Controller
from app.files.scene_source import SceneSource
from app.lessons.facts import FUNCTIONS, VALUES, facts_of, values_used
from app.lessons.lesson import ANY_SCENE, Lesson
from app.lessons.opening import scene_of_lesson
from app.lessons.player import Player, Status
from app.lessons.reader import lesson_names, load_lesson, read_lesson
from app.lessons.scenes import is_lesson_scene, load_lesson_scene
from app.lessons.typeset import formula, line, paragraphs
from app.lessons.vocabulary import understand_action
from app.page_state.page_state import PageState
from app.page_state.selection import Selection
from fairing.errors import InputError
from fairing.run.session import Session
from tests.small_scene import corner_scene, small_options

pytestmark = pytest.mark.usefixtures("remembered_steps")


def wait_for(condition: Callable[[], bool], seconds: float = 300.0) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.005)


def arrive(player: Player) -> None:
    wait_for(lambda: player.status is not Status.AT_WORK)
    assert player.status is Status.THERE, player.problem


@pytest.fixture
def controller():
    controller = Controller(Session(load_lesson_scene("cube")))
    yield controller
    controller.close()


@pytest.fixture
def player(controller: Controller):
    return Player(controller, lambda: None)


@pytest.fixture
def lesson() -> Lesson:
    return load_lesson("model")


@pytest.mark.slow
@pytest.mark.parametrize("name", lesson_names())
def test_every_claim_of_every_lesson_holds(name: str):
    lesson = load_lesson(name)
    scene = corner_scene() if lesson.scene == ANY_SCENE else load_lesson_scene(lesson.scene)
    controller = Controller(Session(scene))
    player = Player(controller, lambda: None)
    try:
        player.open(lesson)
        for n, step in enumerate(lesson.steps):
            if n:
                player.next()
            arrive(player)
            found = player.findings[n]
            assert [claim for claim, holds in found.claims if not holds] == [], f"step {n + 1}: {found.numbers}"
            unknown = [text for text, value in found.numbers.items() if not np.isfinite(value)]
            assert unknown == [], f"step {n + 1}"
            assert len(found.claims) == len(step.claims)
            assert not player.has_strayed(controller.state, _led(player))
    finally:
        controller.close()


SWITCHES = """

```switch
step one iteration: off(0)
robust loss: robust.norm=least_squares
damping: step.damping_always=on step.initial_damping=1
```
"""


@pytest.fixture
def switching() -> Lesson:
    head = "---\ntitle: t\nabout: a\nscene: cube\n---\n"
    locked = "locked_vertices=1,2,3,4,5,6 step.smoothing=0 schedule.blur=6,2"
    first = f"# One\n\n```do\nstart accurate as main: {locked}\nstep one iteration\n```\n\nText.{SWITCHES}\n"
    return read_lesson("switching", head + first + "".join(f"# {n}\n\nText.\n\n" for n in range(5)))


def test_a_check_box_compares_a_branch_without_with_one_with_all(player: Player, switching: Lesson):
    controller = player._controller
    player.open(switching)
    arrive(player)
    start = controller.state.run_id
    assert player.measured == {}
    player.switch(1)
    arrive(player)
    everything, damped = player.measured[0, frozenset()], player.measured[0, frozenset({1})]
    state = controller.state
    assert state.options.step.damping_always
    assert state.moment == 2
    assert not player.has_strayed(state, _led(player)), "a branch of the check boxes belongs to the step"
    # A damped step is shorter, so that more of the error is left.
    assert damped > everything > 0
    player.switch(0)
    arrive(player)
    assert set(player.measured) == {(0, frozenset()), (0, frozenset({1})), (0, frozenset({0, 1}))}
    count = len(controller.state.runs)
    player.switch(0)
    arrive(player)
    assert len(controller.state.runs) == count, "a branch that was made is not made again"
    assert controller.state.run_id == state.run_id
    player.switch(1)
    arrive(player)
    assert controller.state.options == next(run for run in controller.state.runs if run.run_id == start).options
    player.go_on()
    arrive(player)
    assert (controller.state.run_id, controller.state.moment) == (start, 1), "the lesson goes on where the step ended"
    assert not player.has_strayed(controller.state, _led(player))


def test_a_check_box_that_is_not_there_is_refused(player: Player, switching: Lesson):
    player.open(switching)
    arrive(player)
    with pytest.raises(InputError, match="no such check box"):
        player.switch(2)
    player.next()
    arrive(player)
    with pytest.raises(InputError, match="no such check box"):
        player.switch(0)


@pytest.mark.parametrize(
    ("block", "named"),
    [
        ("look at mesh: off(0)\nloss: robust.norm=huber", "expected a line such as"),
        ("step one sweep: off(0)", "expected a line such as"),
        ("step one sweep: off(0)\nloss", "expected `label: options`"),
        ("step one sweep: off(0)\nloss: robust.nrom=huber", "option"),
    ],
)
def test_mistakes_in_a_block_of_switches_are_named(block: str, named: str):
    head = "---\ntitle: t\nabout: a\nscene: cube\n---\n"
    steps = "".join(f"# {n}\n\nText.\n\n" for n in range(6))
    with pytest.raises(InputError, match=named):
        read_lesson("wrong", f"{head}{steps}# Last\n\n```switch\n{block}\n```\n\nText.\n")


def test_a_lesson_knows_the_pull_of_a_term_at_a_vertex():
    session = Session(corner_scene(), small_options())
    session.step()
    text = next(iter(_expressions("pull(photos, 0)")))
    facts = facts_of(session, None, {})
    expected = next(pull for pull in session.pulls() if pull.name == "photos").step_px[0]
    assert text.evaluate(facts) == pytest.approx(expected)
    failing = next(iter(_expressions("pull(photos, 0) < 0")))
    assert values_used(failing, facts) == {"pull(photos, 0)": pytest.approx(expected)}


def _expressions(*texts: str):
    head = "---\ntitle: t\nabout: a\nscene: cube\n---\n"
    steps = "".join(f"# {n}\n\nText.\n\n" for n in range(6))
    for text in texts:
        yield read_lesson("one", f"{head}{steps}# Last\n\n```claim\n{text}\n```\n\nText.\n").steps[-1].claims[0]


def _led(player: Player) -> PageState:
    """A view that the player has led."""
    view = PageState()
    due = player.take_settings()
    assert due is not None
    due[0].set_in(view)
    return view


@pytest.mark.parametrize("name", lesson_names())
def test_lessons_are_typeset_without_a_rest(name: str):
    lesson = load_lesson(name)
    for step in lesson.steps:
        question = step.question
        texts = [step.text, *((question.text, question.answer, *question.choices) if question else ())]
        for text in texts:
            shown = paragraphs(text, dict.fromkeys(step.numbers, 1.5))
            outside = "".join(part.split("</math>")[-1] for part in shown.split("<math"))
            assert not set("${}") & set(outside), outside
            assert "…" not in outside


def test_going_back_restores_the_moment_and_going_on_computes_nothing_anew(player: Player, lesson: Lesson):
    controller = player._controller
    player.open(lesson)
    for _ in lesson.steps[1:]:
        arrive(player)
        player.next()
    arrive(player)
    last, length = controller.state.moment, controller.state.length
    ends = dict(player._ends)
    player.go(5)
    arrive(player)
    assert (controller.state.run_id, controller.state.moment) == (ends[5].run_id, ends[5].moment)
    player.go(len(lesson.steps) - 1)
    arrive(player)
    assert (controller.state.moment, controller.state.length, len(controller.state.runs)) == (last, length, 1)


def test_a_user_who_explores_is_left_alone_and_can_resume(player: Player, lesson: Lesson):
    controller = player._controller
    player.open(lesson)
    arrive(player)
    player.go(5)
    arrive(player)
    view, end = _led(player), player._ends[5]
    assert not player.has_strayed(controller.state, view)
    controller.post(JumpTo(0))
    state = controller.wait_until_idle()
    assert player.has_strayed(state, view)
    assert player.take_settings() is None, "nothing is changed unasked"
    player.go_on()
    arrive(player)
    assert controller.state.moment == end.moment
    due = player.take_settings()
    assert due is not None
    assert due[1], "the eye is led back, too"
    view.selection = Selection((3,))
    assert player.has_strayed(controller.state, view)


def test_a_step_that_a_user_pauses_goes_on_where_it_was(
    player: Player, lesson: Lesson, monkeypatch: pytest.MonkeyPatch
):
    controller, step = player._controller, Session.step
    player.open(lesson)
    arrive(player)
    player.go(5)
    arrive(player)
    with monkeypatch.context() as patch:
        patch.setattr(Session, "step", lambda self: time.sleep(0.02) or step(self))
        player.next()
        wait_for(lambda: controller.state.moment > 3)
        controller.post(Pause())
        wait_for(lambda: player.status is Status.CUT_SHORT)
    paused = controller.state.moment
    assert 0 < paused < 60
    assert 6 not in player.findings, "its claims are about its end"
    controller.post(JumpTo(0))
    controller.wait_until_idle()
    player.next()
    arrive(player)
    assert player.step == 6
    assert all(holds for _, holds in player.findings[6].claims)


def test_going_back_while_the_engine_is_at_work_ends_the_work(
    player: Player, lesson: Lesson, monkeypatch: pytest.MonkeyPatch
):
    controller, step = player._controller, Session.step
    player.open(lesson)
    arrive(player)
    player.go(5)
    arrive(player)
    monkeypatch.setattr(Session, "step", lambda self: time.sleep(0.02) or step(self))
    player.next()
    wait_for(lambda: controller.state.moment > 3)
    player.back()
    arrive(player)
    state = controller.wait_until_idle()
    assert (player.step, state.moment) == (5, player._ends[5].moment)


def test_a_deleted_run_is_made_again(player: Player, lesson: Lesson, controller: Controller):
    player.open(lesson)
    player.go(5)
    arrive(player)
    run_id = controller.state.run_id
    controller.post(Restart(replace(controller.state.options, lock_boundary=True)))
    controller.post(DeleteRun(run_id))
    controller.wait_until_idle()
    player.go_on()
    arrive(player)
    assert controller.state.run_id != run_id
    assert controller.state.moment == 1


def test_a_lesson_begun_while_the_engine_runs_ends_the_run(player: Player, lesson: Lesson, controller: Controller):
    controller.post(Run())
    player.open(lesson)
    arrive(player)
    assert controller.wait_until_idle().moment == 0


def test_another_player_resumes_a_lesson_at_its_step_with_its_locks_and_computes_nothing_anew(
    player: Player, controller: Controller
):
    player.open(load_lesson("beyond"))
    arrive(player)
    player.go(3)
    arrive(player)
    left, progress = controller.state, player.progress
    assert progress is not None
    assert left.locked.any(), "the lesson locks vertices"
    player.leave()
    controller.post(Restart())
    assert controller.wait_until_idle().run_id != left.run_id
    other = Player(controller, lambda: None)
    other.resume(progress)
    arrive(other)
    state = controller.state
    assert (other.lesson, other.step) == (load_lesson("beyond"), 3)
    assert (state.run_id, state.moment, state.length) == (left.run_id, left.moment, left.length)
    np.testing.assert_array_equal(state.locked, left.locked)
    assert other.findings == player.findings
    assert not other.has_strayed(state, _led(other))
    other.next()
    arrive(other)
    assert all(holds for _, holds in other.findings[4].claims)


def test_a_page_that_goes_while_the_engine_is_at_work_leaves_a_step_that_another_player_does_again(
    player: Player, lesson: Lesson, controller: Controller
):
    player.open(lesson)
    arrive(player)
    player.go(len(lesson.steps) - 1)
    progress = player.progress
    player.leave()
    assert progress is not None
    other = Player(controller, lambda: None)
    other.resume(progress)
    arrive(other)
    assert other.step == len(lesson.steps) - 1
    assert all(holds for _, holds in other.findings[other.step].claims)


def test_a_lesson_on_another_scene_is_refused(player: Player, lesson: Lesson):
    with pytest.raises(InputError, match="needs another scene"):
        player.open(replace(lesson, scene="archway"))
    assert player.lesson is None


def test_a_lesson_named_on_the_command_line_finds_its_scene_or_names_what_to_omit():
    cube, facade = SceneSource("cube"), SceneSource("facade")
    assert is_lesson_scene("cube", scene_of_lesson("model", cube)(lambda fraction, line: None))
    assert scene_of_lesson("capture", facade) == facade.load
    with pytest.raises(InputError, match="uses the demo cube; omit facade"):
        scene_of_lesson("model", facade)
    with pytest.raises(InputError, match="expected one of model, cells"):
        scene_of_lesson("nonsense", cube)


def test_the_first_answer_counts(player: Player, lesson: Lesson):
    player.open(lesson)
    arrive(player)
    player.choose(0)
    player.choose(1)
    assert player.chosen == {0: 0}
    with pytest.raises(InputError, match="no such choice"):
        player.choose(9)


def test_numbers_of_a_vertex_agree_with_the_truth(controller: Controller):
    scene = controller.scene
    facts = facts_of(Session(scene), 0, {"kept": 2.5})
    assert scene.truth is not None
    assert scene.truth.vertices is not None
    offset = scene.mesh.vertices[0] - scene.truth.vertices[0]
    assert facts.functions["off"](0) == pytest.approx(100 * np.linalg.norm(offset))
    assert facts.functions["off_y"](0) == pytest.approx(100 * offset[1])
    assert facts.values["kept"]() == 2.5
    assert facts.values["cells"]() == len(scene.views)
    assert facts.functions["share"](len(scene.views)) == pytest.approx(100)
    assert np.isnan(facts.functions["off"](99))
    assert set(facts.values) == {*VALUES, "kept"}
    assert set(facts.functions) == set(FUNCTIONS)


HEAD = "---\ntitle: T\nabout: A.\nscene: cube\n---\n"
STEPS = "".join(f"# Step {n}\n\nText.\n\n" for n in range(6))


@pytest.mark.parametrize(
    ("written", "complaint"),
    [
        ("# A step", "lines `name: value` between two lines"),
        (HEAD.replace("scene: cube\n", "") + STEPS, "expected title, about and scene"),
        (HEAD.replace("cube", "moon") + STEPS, "scene: expected one of any, cube"),
        (HEAD + STEPS.replace("# Step 0\n", ""), "expected 6 to 12 steps, found 5"),
        (HEAD + STEPS.replace("Text.", "```do\nfly to the moon\n```", 1), "step 1 .Step 0.: expected a text"),
        (HEAD + STEPS.replace("Text.", "Text\n```do\nfly to the moon\n```", 1), "step 1.*expected an action such as"),
        (HEAD + STEPS.replace("Text.", "Text\n```do\ntake nobody\n```", 1), "run: expected one of"),
        (HEAD + STEPS.replace("Text.", "Text {offf(0)}", 1), "'offf' is not known"),
        (HEAD + STEPS.replace("Text.", "Text\n```claim\noff(0) <\n```", 1), "expected a number or a name"),
        (HEAD + STEPS.replace("Text.", "Text\n```code\nmagic\n```", 1), "code: expected one of level"),
        (HEAD + STEPS.replace("Text.", "Text\n```keep\noff = 1\n```", 1), "a name of its own"),
        (HEAD + STEPS.replace("Text.", "Text\n```ask\nWhy?\n- a\n- b\n\nBecause.\n```", 1), "found 0 of 2"),
    ],
)
def test_a_mistake_in_a_lesson_is_named(written: str, complaint: str):
    with pytest.raises(InputError, match=complaint):
        read_lesson("probe", written)


@pytest.mark.parametrize(
    "line",
    [
        "start accurate as main: cells.size=abc",
        "start accurate as main: nonsense=1",
        "start turbo as main",
        "step 1000 sweeps",
        "step one mile",
        "show everything",
        "surface golden",
        "run until later",
        "magnify 1000",
        "arrows 2",
        "__import__('os')",
    ],
)
def test_an_action_outside_the_vocabulary_is_refused(line: str):
    with pytest.raises(InputError, match=r"expected|not known"):
        understand_action(line, set())


def test_text_from_a_lesson_is_escaped_and_formulas_are_mathml():
    assert "<script" not in line("<script>alert(1)</script> `<b>`", {})
    assert line("{x} and {y}", {"x": 3.0}) == "<b>3</b> and <b>…</b>"
    assert formula(r"\sum_i e_i^2", is_block=True).startswith("<math")
    assert paragraphs("- a\n- *b*", {}) == "<ul><li>a</li><li><em>b</em></li></ul>"
