"""The debugger's semantics, without a browser."""

import threading
import time
from dataclasses import replace

import numpy as np
import pytest

import fairing.run.sweep_cache
from app.debugger.commands import (
    Back,
    Branch,
    DeleteRun,
    Extent,
    Forward,
    JumpTo,
    Pause,
    Play,
    Query,
    Race,
    Restart,
    Run,
    RunBack,
    SwitchTo,
    ToBeginning,
)
from app.debugger.controller import Controller
from app.debugger.history import EnergyHistory, PathHistory
from app.debugger.run_state import Activity, RunState
from app.debugger.schedule_extents import Extents
from demo_scenes import Photography, load_demo
from fairing.errors import Cancelled
from fairing.options import FairingOptions
from fairing.run.session import Session
from fairing.scene import Scene
from fairing.solve.problem import Problem
from fairing.stage_kind import StageKind
from fairing.trace import Trace
from tests.commands import do
from tests.small_scene import corner_scene, small_options
from tests.two_levels import two_levels
from tests.waiting import wait_for

OPTIONS = two_levels("sequential", sweeps=2, iterations=3)


@pytest.fixture(scope="module")
def scene() -> Scene:
    return load_demo("cube", Photography())


@pytest.fixture
def controller(scene: Scene):
    controller = Controller(Session(scene, OPTIONS))
    yield controller
    controller.close()


def test_starts_paused_at_the_start(controller: Controller):
    state = controller.state
    assert (state.moment, state.length, state.activity) == (0, 0, Activity.PAUSED)
    assert state.record is None


def test_steps_of_every_extent_end_where_their_extent_ends(controller: Controller):
    state = do(controller, Forward(Extent.ITERATION))
    assert state.moment == 1
    for extent in (Extent.BLOCK, Extent.SWEEP, Extent.LEVEL):
        began = controller.state.position
        state = do(controller, Forward(extent))
        last = state.trace.steps[state.moment - 1].position
        assert last[:extent] == began[:extent]
        assert state.position[:extent] != began[:extent], f"{extent.name} did not come to its end"


def test_back_goes_to_the_beginning_of_the_last_extent(controller: Controller):
    state = do(controller, Forward(Extent.LEVEL))
    assert state.moment > 6
    for extent in (Extent.ITERATION, Extent.BLOCK, Extent.SWEEP, Extent.LEVEL):
        expected = Extents(state.trace, extent).boundary_before(controller.state.moment)
        state = do(controller, Back(extent))
        assert state.moment == expected
        np.testing.assert_array_equal(state.vertices, state.trace.vertices_at(expected))
    assert state.moment == 0
    assert do(controller, Back(Extent.BLOCK)).reason == "at the start"


def test_what_is_done_to_the_start_is_stepped_by_itself():
    controller = Controller(Session(corner_scene(), small_options(step={"smoothing": [0.1, 0.03, 0.01]})))
    stages: list[StageKind] = []
    while StageKind.PHOTOS not in stages:
        state = do(controller, Forward(Extent.ITERATION))
        stages.append(state.trace.steps[state.moment - 1].stage)
        assert state.moment == len(stages)
    n_passes = len(stages) - 2
    assert n_passes > 1
    assert stages == [StageKind.SMOOTHNESS] * n_passes + [StageKind.JUDGE, StageKind.PHOTOS]
    for moment in reversed(range(len(stages))):
        assert do(controller, Back(Extent.ITERATION)).moment == moment
    controller.close()


def test_forward_over_the_record_repeats_it(controller: Controller):
    first = do(controller, Forward(Extent.SWEEP))
    vertices, length = first.vertices, first.length
    again = do(controller, JumpTo(0), Forward(Extent.SWEEP))
    assert again.length == length
    np.testing.assert_array_equal(again.vertices, vertices)


def test_run_works_the_schedule_off_as_a_session_alone_does(controller: Controller, scene: Scene):
    state = do(controller, Run())
    assert state.finished
    assert state.progress == 1
    alone = Session(scene, OPTIONS)
    assert state.reason == alone.run()
    np.testing.assert_array_equal(state.vertices, alone.vertices)


def test_pause_stops_a_run_after_the_step_in_hand(controller: Controller):
    controller.post(Run())
    wait_for(lambda: controller.state.moment > 0 or controller.state.activity is Activity.RUNNING)
    controller.post(Pause())
    state = controller.wait_until_idle()
    assert not state.finished
    assert state.reason == "paused"
    moment = state.moment
    time.sleep(0.1)
    assert controller.state.moment == moment


def test_a_command_during_a_run_ends_the_run_first(controller: Controller):
    controller.post(Run())
    wait_for(lambda: controller.state.moment > 2)
    controller.post(JumpTo(1))
    assert controller.wait_until_idle().moment == 1


def test_a_key_held_down_leaves_no_queue_behind(controller: Controller):
    do(controller, Forward(Extent.ITERATION))
    for _ in range(200):
        controller.post(Forward(Extent.ITERATION))
    state = controller.wait_until_idle()
    assert state.moment < 30, f"{state.moment} steps were made of 200 repeats within milliseconds"


def test_only_the_newest_of_many_jumps_counts(controller: Controller):
    last = do(controller, Forward(Extent.LEVEL)).length
    for moment in range(last):
        controller.post(JumpTo(moment))
    assert controller.wait_until_idle().moment == last - 1


def test_jumps_beyond_the_record_end_at_its_end(controller: Controller):
    length = do(controller, Forward(Extent.SWEEP)).length
    assert do(controller, JumpTo(10**9)).moment == length
    assert do(controller, JumpTo(0), JumpTo(-1)).moment == length


def test_restart_begins_a_new_run_and_keeps_the_old(controller: Controller):
    before = do(controller, Forward(Extent.SWEEP))
    after = do(controller, Restart())
    assert (after.moment, after.length) == (0, 0)
    assert after.run_id != before.run_id
    np.testing.assert_array_equal(after.vertices, before.trace.start)
    again = do(controller, SwitchTo(before.run_id))
    assert (again.moment, again.length, again.trace) == (before.moment, before.length, before.trace)


def test_restarting_an_empty_run_leaves_one_run(controller: Controller):
    assert len(do(controller, Restart(), Restart()).runs) == 1


def test_a_branch_shares_the_past_and_takes_the_new_options(controller: Controller):
    do(controller, Forward(Extent.SWEEP))
    before = do(controller, Back(Extent.BLOCK))
    options = OPTIONS.with_levels(dimensions=1)
    after = do(controller, Branch(options))
    assert after.options.by_level("dimensions") == (1,)
    assert after.moment == after.length == before.moment
    np.testing.assert_array_equal(after.vertices, before.vertices)


def test_a_branch_leaves_the_other_record_and_says_where_it_forked_and_how_it_differs(controller: Controller):
    before = do(controller, Forward(Extent.SWEEP))
    forked = do(controller, Back(Extent.BLOCK)).moment
    options = OPTIONS.with_levels(dimensions=1)
    after = do(controller, Branch(options), Forward(Extent.BLOCK))
    old, new = after.runs
    assert (old.length, old.moment) == (before.length, forked)
    assert (new.parent, new.forked_at, new.length) == (before.run_id, forked, after.length)
    assert "dimensions" in new.differs
    back = do(controller, SwitchTo(old.run_id, before.moment))
    np.testing.assert_array_equal(back.vertices, before.vertices)


def test_a_run_that_was_put_aside_goes_on_as_if_it_had_not_been(controller: Controller, scene: Scene):
    began = do(controller, Forward(Extent.BLOCK)).run_id
    do(controller, Restart(), Forward(Extent.ITERATION), SwitchTo(began))
    state = do(controller, Run())
    alone = Session(scene, OPTIONS)
    alone.run()
    assert state.length == len(alone.trace)
    np.testing.assert_array_equal(state.vertices, alone.vertices)


def test_deleting_the_run_at_hand_leads_to_the_one_it_came_from_and_the_last_one_stays(controller: Controller):
    first = do(controller, Forward(Extent.SWEEP)).run_id
    branch = do(controller, Branch(replace(OPTIONS, lock_boundary=True))).run_id
    state = do(controller, DeleteRun(branch))
    assert state.run_id == first
    assert [run.run_id for run in state.runs] == [first]
    assert "only run" in do(controller, DeleteRun(first)).problem
    assert "does not exist" in do(controller, SwitchTo(branch)).problem


def test_every_run_is_saved_in_a_file_of_its_own(scene: Scene, tmp_path):
    controller = Controller(Session(scene, OPTIONS), save_to=tmp_path / "run.trace")
    first = do(controller, Forward(Extent.SWEEP))
    second = do(controller, Branch(replace(OPTIONS, lock_boundary=True)), Forward(Extent.ITERATION))
    do(controller, SwitchTo(first.run_id), JumpTo(-1), Forward(Extent.ITERATION))
    controller.close()
    assert len(Trace.load(tmp_path / "run.trace")) == first.length + 1
    assert len(Trace.load(tmp_path / "run-2.trace")) == second.length


def test_only_the_current_run_has_threads_and_deleted_runs_none(controller: Controller):
    """The threads of runs that were replaced, left or deleted would add up for as long as the debugger is open."""

    others = set(threading.enumerate())

    def threads() -> int:
        return sum(thread.name.startswith("fairing") for thread in set(threading.enumerate()) - others)

    options = replace(controller.state.options, threads=2)
    do(controller, Restart(options), Forward(Extent.BLOCK))
    for _ in range(3):
        do(controller, JumpTo(1), Branch(options), Forward(Extent.BLOCK))
    assert len(controller.state.runs) > 2
    wait_for(lambda: threads() <= 2)
    for run in controller.state.runs[1:]:
        do(controller, DeleteRun(run.run_id))
    do(controller, Forward(Extent.BLOCK))
    wait_for(lambda: threads() <= 2)


def test_a_race_ends_both_runs_as_each_would_alone(controller: Controller, scene: Scene):
    other = replace(OPTIONS, step=replace(OPTIONS.step, solver="alternating"))
    do(controller, Forward(Extent.BLOCK))
    state = do(controller, Race(OPTIONS, other))
    assert len(state.runs) == 2, "the run that was there takes part"
    for info in state.runs:
        alone = Session(scene, info.options)
        alone.run()
        assert info.finished
        np.testing.assert_array_equal(info.vertices, alone.vertices)


@pytest.mark.parametrize("own", [True, False])
def test_a_race_begins_two_runs_where_nothing_is_recorded(scene: Scene, tmp_path, own: bool):
    first, second = OPTIONS, replace(OPTIONS, step=replace(OPTIONS.step, solver="alternating"))
    controller = Controller(Session(scene, OPTIONS if own else FairingOptions()), save_to=tmp_path / "run.trace")
    state = do(controller, Race(first, second))
    controller.close()
    assert state.problem == ""
    assert [run.options for run in state.runs] == [first, second]
    assert all(run.finished for run in state.runs)
    lengths = [len(Trace.load(tmp_path / name)) for name in ("run.trace", "run-2.trace" if own else "run-3.trace")]
    assert lengths == [run.length for run in state.runs]


def test_a_step_that_is_interrupted_has_never_begun(controller: Controller, scene: Scene):
    alone = Session(scene, OPTIONS)
    alone.run()
    asked = dropped = 0
    session = Session(scene, OPTIONS)

    def cancel_requested() -> bool:  # a little later every time, so that every step comes to its end
        nonlocal asked
        asked += 1
        return asked > 7 * dropped

    session.cancel_requested = cancel_requested
    while not session.finished:
        before = session.moment
        try:
            session.step()
        except Cancelled:
            asked, dropped = 0, dropped + 1
            assert (session.moment, len(session.trace)) == (before, before)
    assert dropped > 5
    assert len(session.trace) == len(alone.trace)
    np.testing.assert_array_equal(session.vertices, alone.vertices)


def test_pause_does_not_wait_for_a_long_step(controller: Controller, monkeypatch: pytest.MonkeyPatch):
    began = threading.Event()
    begin = fairing.run.sweep_cache.begin_sweep

    def endless(problem: Problem, *args, **named):
        began.set()
        while True:
            problem.raise_if_cancelled()
            time.sleep(0.001)

    monkeypatch.setattr(fairing.run.sweep_cache, "begin_sweep", endless)
    controller.post(Run())
    began.wait(5)
    controller.post(Pause())
    state = controller.wait_until_idle(5)
    assert (state.moment, state.reason) == (0, "paused")
    monkeypatch.setattr(fairing.run.sweep_cache, "begin_sweep", begin)
    assert do(controller, Forward(Extent.ITERATION)).moment == 1


def test_a_long_step_says_that_it_is_at_work(controller: Controller, monkeypatch: pytest.MonkeyPatch):
    go_on = threading.Event()
    step = Session.step
    monkeypatch.setattr(Session, "step", lambda self: go_on.wait(10) and step(self))
    heard: list[RunState] = []
    controller.subscribe(heard.append)
    controller.post(Forward(Extent.ITERATION))
    wait_for(lambda: any(state.activity is Activity.STEPPING for state in heard))
    go_on.set()
    assert controller.wait_until_idle().moment == 1


def test_playing_shows_the_record_in_order_and_can_be_paused(controller: Controller):
    length = do(controller, Forward(Extent.SWEEP)).length
    heard: list[RunState] = []
    controller.subscribe(heard.append)
    state = do(controller, JumpTo(0), Play(50.0))
    assert state.moment == state.length == length
    wait_for(lambda: heard[-1].serial == state.serial)
    played = [state.moment for state in heard if state.activity is Activity.PLAYING]
    assert played == sorted(played)
    assert len(set(played)) > 1
    controller.post(Play(0.1))
    wait_for(lambda: controller.state.activity is Activity.PLAYING)
    controller.post(Pause())
    assert controller.wait_until_idle().moment == 0, "from the end it plays from the start"


def test_a_click_on_a_part_of_the_position_goes_to_its_beginning(controller: Controller):
    do(controller, Forward(Extent.LEVEL), Forward(Extent.SWEEP), Forward(Extent.BLOCK), Forward(Extent.ITERATION))
    began = controller.state.position
    for extent in (Extent.BLOCK, Extent.SWEEP, Extent.LEVEL):
        state = do(controller, ToBeginning(extent))
        assert state.position[:extent] == began[:extent]
        assert state.moment == 0 or state.trace.steps[state.moment - 1].position[:extent] != began[:extent]


def test_a_failure_becomes_a_message_and_the_next_command_works(
    controller: Controller, monkeypatch: pytest.MonkeyPatch
):
    def fail(self: Session) -> None:
        raise RuntimeError("the disk is on fire")

    with monkeypatch.context() as patch:
        patch.setattr(Session, "step", fail)
        state = do(controller, Forward(Extent.ITERATION))
    assert state.problem == "RuntimeError: the disk is on fire"
    state = do(controller, Forward(Extent.ITERATION))
    assert state.problem == ""
    assert state.moment == 1


def test_listeners_hear_at_most_fifteen_states_a_second_and_always_the_last(controller: Controller):
    heard: list[RunState] = []
    controller.subscribe(heard.append)
    began = time.monotonic()
    final = do(controller, Run())
    seconds = time.monotonic() - began
    wait_for(lambda: bool(heard) and heard[-1].serial == final.serial)
    assert len(heard) <= 15 * seconds + 4
    assert [state.serial for state in heard] == sorted(state.serial for state in heard)


def test_a_failing_listener_does_not_silence_the_others(controller: Controller):
    heard = threading.Event()

    def fail(_: RunState) -> None:
        raise ValueError("a page is broken")

    controller.subscribe(fail)
    controller.subscribe(lambda state: heard.set() if state.moment else None)
    do(controller, Forward(Extent.ITERATION))
    assert heard.wait(5)


def test_a_question_is_answered_on_the_engine_thread_and_changes_nothing(controller: Controller):
    before = do(controller, Forward(Extent.BLOCK))
    answers = []
    controller.post(Query("me", lambda session: (threading.current_thread().name, session.moment), answers.append))
    controller.post(Query("you", lambda session: 1 / 0, answers.append))
    wait_for(lambda: len(answers) == 2)
    assert answers[0] == ("engine", before.moment)
    assert isinstance(answers[1], ZeroDivisionError)
    after = controller.state
    assert (after.moment, after.reason, after.problem) == (before.moment, before.reason, "")


def test_a_run_stops_after_the_step_a_breakpoint_holds_for(controller: Controller):
    controller.edit_breakpoints(lambda b: b.added("sweep == 2 and about(3)"))
    state = do(controller, Run())
    assert state.reason == "breakpoint: sweep == 2 and about(3)"
    record = state.trace.steps[state.moment - 1]
    assert record.position.sweep == 1
    assert record.vertices.tolist() == [3]
    assert state.breakpoints[0].hits == 1
    first = state.moment
    assert do(controller, Run()).moment == first + 1, "goes on from a breakpoint to the next step it holds for"
    assert do(controller, RunBack()).moment == first
    assert do(controller, RunBack()).moment == 0


def test_breakpoints_that_are_off_or_only_report_do_not_stop(controller: Controller):
    controller.edit_breakpoints(lambda b: b.added("level == 1").added("level == 2"))
    one, two = (item.number for item in controller.state.breakpoints)
    controller.edit_breakpoints(lambda b: b.changed(one, lambda item: replace(item, enabled=False)))
    controller.edit_breakpoints(lambda b: b.changed(two, lambda item: replace(item, logs=True)))
    state = do(controller, Run())
    assert state.finished
    assert state.breakpoints[0].hits == 0
    assert state.breakpoints[1].hits > 0
    assert state.log[-1] == f"moment {state.moment}: level == 2"


def test_a_sweep_step_stops_at_a_breakpoint_an_iteration_step_passes_it(controller: Controller):
    controller.edit_breakpoints(lambda b: b.added("moment == 1 or moment == 3"))
    assert do(controller, Forward(Extent.ITERATION)).moment == 1
    assert do(controller, Forward(Extent.SWEEP)).moment == 3


def test_the_run_is_saved_as_it_goes(scene: Scene, tmp_path):
    controller = Controller(Session(scene, OPTIONS), save_to=tmp_path / "run.trace")
    state = do(controller, Forward(Extent.SWEEP))
    controller.close()
    trace = Trace.load(tmp_path / "run.trace")
    assert len(trace) == state.length
    np.testing.assert_array_equal(trace.vertices_at(len(trace)), state.vertices)


def test_a_recorded_run_opens_at_any_moment(scene: Scene):
    session = Session(scene, OPTIONS)
    session.step_sweep()
    replay = Session(scene, trace=session.trace)
    replay.go_to(2)
    controller = Controller(replay)
    try:
        assert controller.state.moment == 2
        assert controller.state.length == len(session.trace)
        np.testing.assert_array_equal(controller.state.vertices, session.trace.vertices_at(2))
    finally:
        controller.close()


def test_the_energy_of_the_whole_mesh_never_rises_within_a_sweep(controller: Controller, scene: Scene):
    history = EnergyHistory(len(scene.mesh.faces))
    history.update(do(controller, Forward(Extent.BLOCK)))
    state = do(controller, Forward(Extent.SWEEP))
    history.update(state)
    after = history.after
    assert len(after) == state.length
    assert (np.diff(after) <= 1e-9 * after[:-1]).all()


def test_paths_lead_from_the_start_to_now(controller: Controller, scene: Scene):
    history = PathHistory(len(scene.mesh.vertices))
    state = do(controller, Run(), JumpTo(7))
    history.update(state)
    pieces, when, owner = history.segments(state)
    for vertex in np.unique(owner):
        path = pieces[owner == vertex]
        np.testing.assert_array_equal(path[0, 0], state.trace.start[vertex])
        np.testing.assert_array_equal(path[-1, 1], state.vertices[vertex])
    assert (when[:, 0] < when[:, 1]).all()


def test_of_too_many_paths_the_longest_are_kept_whole(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("app.debugger.history.PATH_SEGMENTS", 30)
    session = Session(corner_scene(), small_options())
    controller = Controller(session)
    state = do(controller, Run())
    controller.close()
    every, few = PathHistory(len(state.vertices)), PathHistory(len(state.vertices))
    every.update(state)
    few.update(state)
    monkeypatch.setattr("app.debugger.history.PATH_SEGMENTS", 8)
    pieces, _, owner = few.segments(state)
    monkeypatch.setattr("app.debugger.history.PATH_SEGMENTS", 10_000)
    all_pieces, _, all_owner = every.segments(state)
    assert 0 < len(pieces) <= 8 < len(all_pieces)
    lengths = {
        vertex: np.linalg.norm(np.diff(all_pieces[all_owner == vertex], axis=1), axis=-1).sum()
        for vertex in np.unique(all_owner)
    }
    shown = set(owner.tolist())
    for vertex in shown:
        assert (owner == vertex).sum() == (all_owner == vertex).sum()
    assert min(lengths[v] for v in shown) >= max(lengths[v] for v in lengths if v not in shown)


def test_a_long_query_is_reported_while_the_engine_is_paused(controller: Controller):
    may_end, results = threading.Event(), []

    def compute(session: Session) -> int:
        with session.work.doing("measuring", 4, "face") as work:
            work.advance()
            may_end.wait()
        return 7

    try:
        controller.query("a test", compute, results.append)
        wait_for(lambda: controller.state.work is not None)
        state = controller.state
        assert state.activity is Activity.PAUSED
        assert state.work is not None
        assert (state.work.text, state.work.fraction) == ("measuring: face 2 of 4", 0.25)
    finally:
        may_end.set()
    wait_for(lambda: controller.state.work is None)
    assert results == [7]
