"""No exception ends the debugger: failures are injected into commands, properties, listeners and threads."""

import json
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from app.debugger.command_queue import CommandQueue
from app.debugger.commands import Branch, Extent, Forward, JumpTo, Lock, Pause, Place, Query, Run, SaveReport
from app.debugger.controller import Controller
from app.debugger.run_state import Activity, RunState
from fairing.errors import Cancelled, InputError
from fairing.run.session import Session
from fairing.trace import Trace
from tests.commands import do
from tests.small_scene import corner_scene, small_options

LIMIT = 0.5  # s: a thread that does not respond for so long counts as stuck


@pytest.fixture
def controller() -> Iterator[Controller]:
    controller = Controller(Session(corner_scene(), small_options()), limits=(LIMIT, LIMIT))
    yield controller
    controller.close()


def failing(error: BaseException):
    def fail(*_: object) -> None:
        raise error

    return property(fail)


@pytest.mark.parametrize("name", ["progress", "position", "locked"])
@pytest.mark.parametrize("error", [Cancelled(), ZeroDivisionError("no blocks"), InputError("no photo")])
def test_a_property_that_raises_ends_nothing_and_is_notified_once(
    controller: Controller, monkeypatch: pytest.MonkeyPatch, name: str, error: Exception
):
    do(controller, Forward(Extent.ITERATION))
    with monkeypatch.context() as patch:
        patch.setattr(Session, name, failing(error))
        for _ in range(3):
            state = do(controller, JumpTo(0), JumpTo(1))
            assert_consistent(state)
        is_reported = not isinstance(error, Cancelled)
        assert state.problems == int(is_reported)
        assert (state.incident is not None) == is_reported
        if state.incident is not None:
            assert name in state.incident.where
            assert type(error).__name__ in state.incident.details
    state = do(controller, Forward(Extent.ITERATION))
    assert (state.moment, state.problem) == (2, "")


def test_a_state_that_cannot_be_read_at_all_leaves_the_last_one(
    controller: Controller, monkeypatch: pytest.MonkeyPatch
):
    before = do(controller, Forward(Extent.ITERATION))
    with monkeypatch.context() as patch:
        patch.setattr(Trace, "vertices_at", lambda *_: 1 / 0)
        state = do(controller, JumpTo(0))
        assert state.moment == before.moment
        assert "ZeroDivisionError" in state.problem
    state = do(controller, JumpTo(0))
    assert (state.moment, state.problem) == (0, "")


def test_a_listener_that_raises_is_in_the_report_and_the_others_are_called(controller: Controller, tmp_path: Path):
    called = threading.Event()

    def fail(_: RunState) -> None:
        raise ValueError("a page is broken")

    controller.subscribe(fail)
    controller.subscribe(lambda state: called.set() if state.moment else None)
    state = do(controller, Forward(Extent.ITERATION))
    assert called.wait(10)
    assert state.problems == 0
    wait_for(lambda: "a page is broken" in controller.save_report(tmp_path / "report.json").read_text())


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_dead_engine_thread_is_restarted_on_the_same_session(controller: Controller, monkeypatch: pytest.MonkeyPatch):
    def end(_: Session) -> None:
        raise SystemExit("out of luck")

    before = do(controller, Forward(Extent.BLOCK))
    first = controller._engine._thread
    with monkeypatch.context() as patch:
        patch.setattr(Session, "step", end)
        controller.post(Forward(Extent.BLOCK))
        state = controller.wait_until_idle(60)
    assert first is not controller._engine._thread
    assert (state.moment, state.length, state.trace) == (before.moment, before.length, before.trace)
    assert state.problems == 1, "one notification"
    assert "SystemExit: out of luck" in state.problem
    assert "record is kept" in state.problem
    assert state.incident is not None
    assert (state.incident.what, state.incident.where) == ("dead", "engine")
    again = do(controller, Forward(Extent.BLOCK))
    assert again.moment > before.moment
    assert again.problem == ""


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_query_that_ends_the_thread_does_not_block_the_next_one(controller: Controller):
    def end(_: Session) -> None:
        raise SystemExit

    results = []
    controller.post(Query("a", end, results.append))
    controller.post(Query("b", lambda session: session.moment, results.append))
    wait_for(lambda: results == [0])
    assert do(controller, Forward(Extent.ITERATION)).moment == 1


def test_a_stuck_engine_is_replaced_and_what_it_does_later_has_no_effect(tmp_path: Path):
    controller = Controller(Session(corner_scene(), small_options()), tmp_path / "run.trace", limits=(LIMIT, LIMIT))
    try:
        gate, entered, left = threading.Event(), threading.Event(), threading.Event()
        before = do(controller, Forward(Extent.ITERATION), Forward(Extent.ITERATION))
        step = Session.step

        def wait(session: Session) -> object:
            entered.set()
            gate.wait(60)
            try:
                return step(session)
            finally:
                left.set()

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(Session, "step", wait)
            controller.post(Run())
            assert entered.wait(10)
            controller.post(Pause())
            state = controller.wait_until_idle(60)
        assert state.incident is not None
        assert (state.incident.what, state.incident.where) == ("stuck", "engine")
        assert "gate.wait" in state.incident.details
        assert (state.moment, state.length) == (before.moment, before.length)
        np.testing.assert_array_equal(state.vertices, before.vertices)
        gate.set()
        assert left.wait(60)
        time.sleep(0.1)
        assert controller.state.length == before.length, "the old thread works on a session of its own"
        state = do(controller, Run())
        assert state.finished
        assert state.problems == 1
    finally:
        controller.close()
    alone = Session(corner_scene(), small_options())
    alone.run()
    np.testing.assert_array_equal(state.vertices, alone.vertices)
    assert len(Trace.load(tmp_path / "run.trace")) == state.length


def test_a_stuck_listener_does_not_stop_the_publication_for_others(controller: Controller):
    gate, calls, seen = threading.Event(), [], []

    def block(state: RunState) -> None:
        calls.append(state.serial)
        gate.wait(60)

    controller.subscribe(block)
    controller.subscribe(seen.append)
    wait_for(lambda: bool(calls))
    state = do(controller, Forward(Extent.ITERATION))
    wait_for(lambda: bool(seen) and seen[-1].moment == state.moment)
    assert len(calls) == 1, "not called again before it returns"
    assert controller.state.problems == 1
    assert controller.state.incident is not None
    assert (controller.state.incident.what, controller.state.incident.where) == ("stuck", "publisher")
    gate.set()
    wait_for(lambda: len(calls) > 1 and calls[-1] == controller.state.serial)


def test_a_dead_publisher_is_restarted(controller: Controller):
    seen: list[RunState] = []

    def end(_: RunState) -> None:
        controller_unsubscribe()
        raise SystemExit("publisher")

    controller.subscribe(seen.append)
    controller_unsubscribe = controller.subscribe(end)
    wait_for(lambda: controller.state.incident is not None)
    state = do(controller, Forward(Extent.ITERATION))
    wait_for(lambda: seen[-1].moment == state.moment)
    assert state.problems == 1


def test_nothing_is_computed_while_holding_the_lock_that_post_needs(
    controller: Controller, monkeypatch: pytest.MonkeyPatch
):
    gate, entered = threading.Event(), threading.Event()

    def wait(_: Session) -> float:
        entered.set()
        gate.wait(60)
        return 0.5

    monkeypatch.setattr(Session, "progress", property(wait))
    controller.post(Forward(Extent.ITERATION))
    assert entered.wait(10)
    began = time.monotonic()
    controller.post(Query("a", lambda _: None, lambda _: None))
    controller.edit_breakpoints(lambda breakpoints: breakpoints.added("level == 9"))
    controller.republish()
    assert time.monotonic() - began < 5
    gate.set()
    assert controller.wait_until_idle(60).moment == 1


def test_a_command_goes_before_a_query_in_progress_which_is_computed_afterwards(controller: Controller):
    entered, results = threading.Event(), []

    def compute(session: Session) -> int:
        entered.set()
        while session.moment == 0:
            if session.cancel_requested():
                raise Cancelled
            time.sleep(0.001)
        return session.moment

    controller.post(Query("a", compute, results.append))
    assert entered.wait(10)
    assert do(controller, Forward(Extent.ITERATION)).moment == 1
    wait_for(lambda: results == [1])


def test_waiting_queries_come_after_all_commands():
    queue = CommandQueue()
    first, second = (Query(key, lambda session: session.moment, print) for key in "ab")
    for command in (first, Forward(Extent.LEVEL), second, JumpTo(0)):
        queue.add(command)
    assert queue.has_commands
    assert [queue.take() for _ in range(2)] == [Forward(Extent.LEVEL), JumpTo(0)]
    assert not queue.has_commands
    assert [queue.take() for _ in range(3)] == [first, second, None]


def test_the_report_has_what_a_developer_needs(controller: Controller, tmp_path: Path):
    do(controller, Forward(Extent.ITERATION), JumpTo(0))
    report = json.loads(controller.save_report(tmp_path / "report.json").read_text())
    assert report["scene"]["vertices"] == 7
    assert len(report["scene"]["photos"]) == 8
    assert [level["blur"] for level in report["options"]["levels"]] == [2.0, 1.2, 0.6]
    assert [command.split("(")[0] for command in report["commands"]] == ["Forward", "JumpTo"]
    assert set(report["threads"]) == {"engine", "publisher"}
    assert report["run"]["length"] == 1


def test_the_report_command_writes_beside_the_record(tmp_path: Path):
    controller = Controller(Session(corner_scene(), small_options()), save_to=tmp_path / "run.trace")
    state = do(controller, SaveReport())
    controller.close()
    assert state.reason == f"problem report saved: {tmp_path / 'run.report.json'}"
    assert json.loads((tmp_path / "run.report.json").read_text())["run"]["moment"] == 0


# ---------------------------------------------------------------------- two ways in which the engine thread once died


def test_a_pause_while_a_new_branch_is_prepared_ends_nothing():
    """With other options a branch prepares its start anew, which a pause cancels."""
    options = small_options(step={"smoothing": [0.1]})
    for delay in (0.0, 0.005, 0.02, 0.05, 0.1):
        controller = Controller(Session(corner_scene(), small_options()))
        try:
            do(controller, Forward(Extent.SWEEP))
            controller.post(Branch(options))
            time.sleep(delay)
            controller.post(Pause())
            state = controller.wait_until_idle(60)
            assert controller._engine.is_alive
            assert_consistent(state)
            state = do(controller, Forward(Extent.ITERATION))
            assert state.problems == 0
        finally:
            controller.close()


def test_locking_every_vertex_within_a_sweep_ends_nothing(controller: Controller):
    """No block of the sweep is left then, of which a fraction could be done."""
    state = do(controller, Forward(Extent.SWEEP), Forward(Extent.ITERATION))
    state = do(controller, Lock(tuple(range(len(state.vertices))), locked=True))
    assert controller._engine.is_alive
    assert_consistent(state)
    assert state.locked.all()
    state = do(controller, Forward(Extent.ITERATION))
    assert_consistent(state)


def test_progress_is_defined_when_every_vertex_is_locked_within_a_sweep(controller: Controller):
    state = do(controller, Forward(Extent.SWEEP), Forward(Extent.ITERATION))
    state = do(controller, Lock(tuple(range(len(state.vertices))), locked=True))
    assert state.incident is None
    assert 0 <= state.progress <= 1


@pytest.mark.parametrize(
    "command",
    [
        Place((7,), ((0.0, 0.0, 0.0),)),
        Place((-1,), ((0.0, 0.0, 0.0),)),
        Place((0,), ((float("nan"), 0.0, 0.0),)),
        Place((), ()),
        Place((0, 1), ((0.0, 0.0, 0.0),)),
        Lock((99,), locked=True),
    ],
)
def test_commands_out_of_range_are_refused_in_one_line(controller: Controller, command):
    state = do(controller, command)
    assert state.problem.startswith("vert")
    assert state.incident is None


def assert_consistent(state: RunState) -> None:
    assert state.activity is Activity.PAUSED
    assert 0 <= state.moment <= state.length <= len(state.trace)
    np.testing.assert_array_equal(state.vertices, state.trace.vertices_at(state.moment))
    if state.moment:
        assert state.position == state.trace.steps[state.moment - 1].next_position


def wait_for(condition, seconds: float = 60.0) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "timed out"
        time.sleep(0.005)
