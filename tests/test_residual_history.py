"""Residuals are measured beside the engine, which never waits for them, and belong to their moments."""

from collections.abc import Iterator

import numpy as np
import pytest

from app.debugger.commands import Branch, Extent, Forward, JumpTo, Restart, Run
from app.debugger.compare import RunEnergies
from app.debugger.controller import Controller
from app.debugger.residual_history import ResidualHistory
from app.debugger.run_state import Activity
from fairing.errors import InputError
from fairing.judge.comparable_residual import ComparableResidual
from fairing.options import PRESETS
from fairing.run.recorded_stages import recorded_stages
from fairing.run.session import Session
from tests.small_scene import corner_scene, small_options
from tests.waiting import wait_for


@pytest.fixture
def controller() -> Iterator[Controller]:
    controller = Controller(Session(corner_scene(), small_options()))
    yield controller
    controller.close()


@pytest.fixture
def history(controller: Controller) -> Iterator[ResidualHistory]:
    n_faces = len(controller.scene.mesh.faces)
    history = ResidualHistory(
        Session(controller.scene), RunEnergies(n_faces), lambda: controller.activity, on_new=controller.republish
    )
    unsubscribe = controller.subscribe(history.follow)
    yield history
    unsubscribe()
    history.close()


@pytest.mark.slow
def test_every_moment_of_a_short_run_is_measured_once_it_pauses(controller: Controller, history: ResidualHistory):
    controller.post(Run())
    state = controller.wait_until_idle()
    wait_for(lambda: history.count(1) == state.length + 1)
    line, measure = history.of(state).line(), ComparableResidual(Session(controller.scene))
    assert line.moments.tolist() == list(range(state.length + 1))
    for moment in (0, state.length // 2, state.length):
        assert line.values[moment] == measure.measure(state.trace.vertices_at(moment)).mean
    assert line.values[-1] < line.values[0]
    ring = controller.scene.mesh.one_rings[1]
    assert history.of(state).line(ring).values[0] == measure.measure(state.trace.start).of_faces(ring)


@pytest.mark.slow
def test_the_start_the_present_and_the_ends_of_stages_come_first(controller: Controller, history: ResidualHistory):
    controller.post(Run())
    controller.wait_until_idle()
    controller.post(JumpTo(1))
    state = controller.wait_until_idle()
    wait_for(lambda: history.count(1) == state.length + 1)
    order = list(history._known[1])
    first = {0, 1, *(stage.end for stage in recorded_stages(state.trace))}
    assert set(order[: len(first)]) == first


@pytest.mark.slow
def test_a_branch_begins_with_what_is_known_of_its_parent(controller: Controller, history: ResidualHistory):
    controller.post(Forward(Extent.LEVEL))
    state = controller.wait_until_idle()
    wait_for(lambda: history.count(1) == state.length + 1)
    controller.post(JumpTo(2))
    controller.post(Branch(small_options(step={"damping_always": True})))
    branched = controller.wait_until_idle()
    assert branched.run_id == 2
    wait_for(lambda: history.count(2) == 3)
    shared, known = history.of(state).by_moment, history.of(branched).by_moment
    assert all(known[moment] is shared[moment] for moment in range(3))


def test_runs_under_other_options_share_their_start(controller: Controller, history: ResidualHistory):
    wait_for(lambda: history.count(1) == 1)
    first = history.of(controller.state).by_moment[0].mean
    controller.post(Restart(PRESETS["paper"]))
    controller.post(Forward(Extent.ITERATION))
    state = controller.wait_until_idle()
    wait_for(lambda: history.count(state.run_id) == 2)
    assert history.of(state).by_moment[0].mean == first


def test_a_run_that_was_left_before_its_start_was_measured_is_measured_whole(
    controller: Controller, history: ResidualHistory, monkeypatch: pytest.MonkeyPatch
):
    with monkeypatch.context() as busy:
        busy.setattr(
            history, "_activity", lambda: Activity.STEPPING
        )  # nothing is measured while the first run is the current one
        controller.post(Forward(Extent.SWEEP))
        length = controller.wait_until_idle().length
        controller.post(Restart(small_options()))
        controller.post(Forward(Extent.ITERATION))
        assert controller.wait_until_idle().run_id == 2
        assert history.count(1) == 0
    controller.republish()
    wait_for(lambda: history.count(1) == length + 1)


def test_nothing_is_measured_while_a_step_is_made():
    session = Session(corner_scene(), small_options())
    activity = [Activity.STEPPING]
    history = ResidualHistory(session, RunEnergies(len(session.scene.mesh.faces)), lambda: activity[0])
    controller = Controller(Session(corner_scene(), small_options()))
    try:
        history.follow(controller.state)
        wait_for(lambda: history._job is None)
        assert history.count(1) == 0
        activity[0] = Activity.PAUSED
        history.follow(controller.state)
        wait_for(lambda: history.count(1) == 1)
    finally:
        history.close()
        controller.close()


def test_a_photo_that_cannot_be_read_is_named_and_the_run_goes_on(
    controller: Controller, history: ResidualHistory, monkeypatch: pytest.MonkeyPatch
):
    wait_for(lambda: history.count(1) == 1)

    def fail(self: ComparableResidual, vertices: np.ndarray) -> None:
        raise InputError("a.png: cannot be decoded")

    monkeypatch.setattr(ComparableResidual, "measure", fail)
    controller.post(Forward(Extent.ITERATION))
    state = controller.wait_until_idle()
    wait_for(lambda: history.of(state).why_not == "a.png: cannot be decoded")
    controller.post(Forward(Extent.ITERATION))
    assert controller.wait_until_idle().length == 2
