"""Restarts of vertices that fit poorly together: they correct them, and take nothing that fits worse."""

from dataclasses import replace

import numpy as np
import pytest

import fairing.run.sweep
from fairing.options import FairingOptions
from fairing.run.fusion import fused
from fairing.run.phases import GaussNewton, LocalSearch, Restart, schedule_of
from fairing.run.restart import restart
from fairing.run.session import Session
from fairing.run.sweep import SweepState
from fairing.solve.blocks import connected_groups, restart_block
from fairing.trace import SchedulePosition, StepReason, StepRecord, Trace
from tests.search_scene import SHARP_AT_LAST, rough_scene, searching
from tests.small_scene import VERTICES, corner_scene

pytestmark = pytest.mark.slow

LEVEL = 1
WRONG = {0: (-0.1, 0.11, 0.1), 1: (0.09, 0.1, -0.08)}  # 8 to 12 px


@pytest.fixture(autouse=True)
def most_fit_poorly(monkeypatch):
    """All faces of this scene meet at vertex 0, so no vertex has twice the median loss."""
    monkeypatch.setattr(fairing.run.sweep, "POOR_FIT", 0.5)


def sharp_session(**changes) -> Session:
    return Session(rough_scene(), searching(10.0, **SHARP_AT_LAST, **changes))


def restarting_sweep(session: Session, vertices: np.ndarray) -> SweepState:
    """The first sweep of the last level, its restart, if it began with the vertices at given positions (n, 3)."""
    session.trace.append(
        replace(
            session.trace.steps[0],
            vertices=np.arange(len(vertices)),
            after=vertices,
            next_position=SchedulePosition(LEVEL, 0, 0, 0),
        )
    )
    return session.sweep_state(len(session.trace))


@pytest.fixture
def begun() -> Session:
    session = sharp_session()
    session.step()
    return session


def restarted(session: Session, vertices: np.ndarray) -> StepRecord:
    """The restart of all vertices from level 0, at the beginning of the last level."""
    sweep = restarting_sweep(session, vertices)
    schedule, block = schedule_of(session.options, session.make_plan()), restart_block(session.scene.mesh, np.arange(7))
    return restart(session._problem, schedule, sweep, block, SchedulePosition(LEVEL, 0, 0, 0), vertices)


def wrong_together() -> np.ndarray:
    places = VERTICES.copy()
    for vertex, offset in WRONG.items():
        places[vertex] += offset
    return places


def errors(vertices: np.ndarray) -> np.ndarray:
    return np.linalg.norm(vertices - VERTICES, axis=1)


def test_vertices_that_are_wrong_together_are_corrected(begun):
    vertices = wrong_together()
    record = restarted(begun, vertices)
    assert set(record.vertices.tolist()) & set(WRONG)
    after = record.applied_to(vertices)
    assert errors(after)[0] < 0.02 < 0.15 < errors(vertices)[0]
    assert record.objective_after < 0.5 * record.objective_before
    moved = (record.before != record.after).any(axis=1)
    assert np.array_equal(moved, record.reasons == StepReason.FOUND_TOGETHER)
    assert (record.reasons[~moved] == StepReason.NO_BETTER_PLACE).all()


def test_nothing_worse_is_taken_at_the_truth(begun):
    record = restarted(begun, VERTICES.copy())
    assert record.objective_after <= record.objective_before
    assert errors(record.applied_to(VERTICES)).max() < 0.01


def test_fusion_takes_each_vertex_from_the_result_where_it_is_right(begun):
    first, second = VERTICES.copy(), VERTICES.copy()
    first[1] += (0.1, 0.0, 0.1)
    second[4] += (0.1, 0.1, 0.0)
    sweep = restarting_sweep(begun, first)
    assert np.array_equal(fused(begun._problem, sweep, first, second), VERTICES)
    assert np.array_equal(fused(begun._problem, sweep, second, first), VERTICES)


def test_a_searched_run_restarts_once_at_the_beginning_of_its_last_level():
    session = sharp_session(schedule={"max_sweeps": [1], "max_iterations": [1]})
    session.run()
    level = schedule_of(session.options, session.make_plan()).levels[LEVEL]
    assert [type(phase) for phase in level.phases] == [Restart, LocalSearch, GaussNewton]
    found = [record for record in session.trace.steps if (record.reasons == StepReason.FOUND_TOGETHER).any()]
    assert [record.position for record in found] == [(LEVEL, 0, 0, 0)]
    assert found[0].objective_after < found[0].objective_before
    assert np.isin(found[0].reasons, (StepReason.FOUND_TOGETHER, StepReason.NO_BETTER_PLACE)).all()
    assert errors(session.vertices)[0] < 0.02


@pytest.mark.slow
def test_a_run_resumed_around_a_restart_writes_the_same_bytes(tmp_path):
    changes = {"schedule": {"max_sweeps": [1], "max_iterations": [1]}}
    whole = sharp_session(**changes, threads=2)
    whole.trace.attach(tmp_path / "whole.trace")
    whole.run()
    whole.trace.detach()
    tried = next(m for m, record in enumerate(whole.trace.steps) if (record.reasons == StepReason.FOUND_TOGETHER).any())
    for stop in (tried, tried + 1):
        session = sharp_session(**changes, threads=2)
        session.trace.attach(tmp_path / "run.trace")
        for _ in range(stop):
            session.step()
        session.trace.detach()
        resumed = Session(rough_scene(), trace=Trace.load(tmp_path / "run.trace"))
        resumed.trace.attach(tmp_path / "run.trace")
        resumed.run()
        resumed.trace.detach()
        assert (tmp_path / "run.trace").read_bytes() == (tmp_path / "whole.trace").read_bytes()
    alone = sharp_session(**changes, threads=1)
    alone.run()
    assert np.array_equal(alone.vertices, whole.vertices)


def test_the_default_restarts_at_its_first_searching_level():
    options = FairingOptions(schedule=replace(FairingOptions().schedule, start_error=9.0))
    session = Session(corner_scene(), options)
    plan = session.make_plan()
    levels = schedule_of(options, plan).levels
    assert levels[4].phases[0] == Restart(max(2, plan.first_level))
    assert not any(isinstance(phase, Restart) for level in levels[:4] for phase in level.phases)


def test_groups_are_those_of_a_walk_along_edges():
    scene = rough_scene()
    for seed in range(20):
        mask = np.random.default_rng(seed).random(7) < 0.5
        groups = connected_groups(scene.mesh, mask)
        assert sorted(np.concatenate(groups).tolist() if groups else []) == np.flatnonzero(mask).tolist()
        for group in groups:
            reached = {int(group[0])}
            for _ in range(7):
                near = {int(w) for face in scene.mesh.faces for v in face if int(v) in reached for w in face if mask[w]}
                reached |= near
            assert reached == set(group.tolist())
