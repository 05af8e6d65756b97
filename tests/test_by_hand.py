"""What becomes of the runs when a user moves, resets and locks vertices, without a browser."""

import numpy as np
import pytest

from app.debugger.commands import Extent, Forward, JumpTo, Lock, Place, Reset, Run
from app.debugger.controller import Controller
from app.debugger.manual_edits import vertex_list
from app.debugger.run_state import RunState
from app.debugger.runs import Runs
from app.palette import HAND
from app.pictures.strip import StepHistory
from fairing.options import FairingOptions
from fairing.run.session import Session
from fairing.trace import StepReason, Trace
from tests.commands import do
from tests.small_scene import corner_scene, small_options


def options() -> FairingOptions:
    schedule = {"order": "joint", "max_sweeps": [2], "max_iterations": [2], "blur": [2.0, 0.8]}
    return small_options(schedule=schedule)


@pytest.fixture
def controller():
    controller = Controller(Session(corner_scene(), options()))
    yield controller
    controller.close()


def place(state: RunState, vertex: int, by: float) -> Place:
    x, y, z = (state.vertices[vertex] + by).tolist()
    return Place((vertex,), ((x, y, z),))


def test_a_move_at_the_end_of_the_record_is_one_more_step_of_it(controller: Controller):
    state = do(controller, Forward(Extent.SWEEP))
    began = (state.run_id, state.length)
    state = do(controller, place(state, 0, 0.02))
    assert (state.run_id, state.length - 1) == began
    assert state.moment == state.length
    assert state.record is not None
    assert state.record.is_manual
    assert state.reason.startswith("vertex 0 moved by hand")
    assert do(controller, Run()).finished


def test_a_move_at_a_past_moment_forks_a_run_and_the_old_one_is_kept(controller: Controller):
    finished = do(controller, Run())
    state = do(controller, JumpTo(2), place(controller.state, 0, 0.02))
    assert state.run_id != finished.run_id
    assert state.moment == state.length == 3
    assert [run.length for run in state.runs] == [finished.length, 3]
    assert state.runs[1].differs == "vertex 0 moved by hand"
    assert np.array_equal(state.trace.vertices_at(2), finished.trace.vertices_at(2))


def test_what_is_refused_changes_nothing_and_is_said(controller: Controller):
    before = do(controller, Run(), JumpTo(2))
    state = do(controller, place(before, 0, -2.0))
    assert "face" in state.problem
    assert "nothing was moved" in state.problem
    assert (state.run_id, state.moment, state.length) == (before.run_id, 2, before.length)
    assert len(state.runs) == 1


def test_reset_goes_back_to_the_start_and_the_run_goes_on(controller: Controller):
    state = do(controller, Run(), Reset((0, 4)))
    assert np.array_equal(state.vertices[[0, 4]], state.trace.start[[0, 4]])
    assert not state.finished
    assert do(controller, Run()).finished


def test_locks_at_the_end_of_the_record_are_the_same_run_with_other_options(controller: Controller):
    before = do(controller, Forward(Extent.SWEEP))
    state = do(controller, Lock((0, 3), locked=True))
    assert (state.run_id, state.length, len(state.runs)) == (before.run_id, before.length, 1)
    assert state.options.locked_vertices == (0, 3)
    held = state.vertices[[0, 3]]
    state = do(controller, Forward(Extent.SWEEP))
    assert np.array_equal(state.vertices[[0, 3]], held)
    assert "locked; unlock it" in do(controller, place(state, 3, 0.01)).problem
    state = do(controller, Lock((3,), locked=False), place(state, 3, 0.01))
    assert state.problem == ""
    assert state.options.locked_vertices == (0,)


def test_locks_at_a_past_moment_fork_a_run(controller: Controller):
    before = do(controller, Run())
    state = do(controller, JumpTo(3), Lock((0,), locked=True))
    assert state.run_id != before.run_id
    assert state.moment == state.length == 3
    assert state.runs[0].options.locked_vertices == ()
    assert state.runs[1].differs == "vertex 0 locked"


def test_a_vertex_locked_by_another_option_stays_locked_and_it_is_said():
    controller = Controller(Session(corner_scene(), small_options(lock_boundary=True)))
    try:
        state = do(controller, Lock((2,), locked=False))
        assert "vertex 2: stays locked" in state.problem
    finally:
        controller.close()


def test_the_file_has_the_move_and_the_locks(tmp_path):
    path = tmp_path / "run.trace"
    controller = Controller(Session(corner_scene(), options()), save_to=path)
    state = do(controller, Forward(Extent.SWEEP), Lock((2,), locked=True))
    state = do(controller, place(state, 0, 0.02), Forward(Extent.SWEEP))
    controller.close()
    resumed = Session(corner_scene(), trace=Trace.load(path))
    assert np.array_equal(resumed.vertices, state.vertices)
    assert resumed.options.locked_vertices == (2,)
    assert resumed.trace.manual_moments == state.trace.manual_moments
    assert len(state.trace.manual_moments) == 1


def test_a_run_with_moves_by_hand_does_not_count_as_one_with_its_options_all_along():
    session = Session(corner_scene(), options())
    runs = Runs(session, None)
    assert runs.from_start_with(options()) == 1
    session.reset(np.array([0]))
    assert runs.from_start_with(options()) is None


def test_the_timeline_shows_where_a_hand_moved_something(controller: Controller):
    state = do(controller, Forward(Extent.SWEEP), place(controller.state, 0, 0.02))
    history = StepHistory()
    history.update(state)
    assert history.picture("energy")[0, -1].tolist() == list(HAND)
    assert history.picture("energy")[0, 0].tolist() != list(HAND)


def test_few_vertices_are_named_and_many_counted():
    assert vertex_list(np.array([4])) == "vertex 4"
    assert vertex_list(np.array([4, 7, 1])) == "vertices 4, 7, 1"
    assert vertex_list(np.arange(9)) == "9 vertices"
    assert StepReason.MOVED_MANUALLY.text == "moved by hand"
