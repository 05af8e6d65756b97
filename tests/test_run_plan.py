"""Run plans: computed once, recorded, cancellable; and nothing but planning and steps ever reads a photo."""

import json
from dataclasses import replace

import numpy as np
import pytest

from fairing.errors import Cancelled, InputError
from fairing.options import FairingOptions, options_from_dict, options_to_dict
from fairing.run.session import Session
from fairing.run_plan import RunPlan
from fairing.scene import Scene, View
from fairing.trace import Trace
from tests.rough_scene import rough_options, rough_scene
from tests.small_scene import HEIGHT, WIDTH, corner_scene, small_options

QUICK = {"max_sweeps": [1], "max_iterations": [2]}


class UnreadablePhoto:
    """A photo that fails the test when it is read."""

    size = (WIDTH, HEIGHT)

    def load(self) -> np.ndarray:
        raise AssertionError("a photo was read")

    def full_depth(self) -> np.ndarray:
        return self.load()


def without_photos(scene: Scene) -> Scene:
    views = tuple(View(view.name, view.camera, UnreadablePhoto()) for view in scene.views)
    return replace(scene, views=views)


def planned() -> FairingOptions:
    """A start that may be smoothed: planning reads all photos."""
    return rough_options(schedule=QUICK)


def everything_shown(session: Session) -> tuple:
    return (
        session.plan, session.position, session.finished, session.progress, session.stop_reason, session.locked.tolist(),
        session.warnings, session.seconds["photos"], session.samples, session.latest_sweep, session.vertices.tolist(),
    )  # fmt: skip


def test_no_property_reads_a_photo_before_the_plan():
    session = Session(without_photos(rough_scene()), planned())
    everything_shown(session)
    assert (session.plan, session.progress, session.position) == (None, 0.0, (0, 0, 0, 0))
    assert session.samples == 0
    with pytest.raises(AssertionError, match="a photo was read"):
        session.step()
    assert session.plan is None


def test_branches_and_replay_read_no_photo():
    recorded = Session(rough_scene(), planned())
    recorded.run()
    session = Session(without_photos(rough_scene()), trace=recorded.trace.cut(len(recorded.trace)))
    for moment in range(len(session.trace) + 1):
        session.go_to(moment)
        everything_shown(session)
        for options in (planned(), planned_otherwise()):
            everything_shown(session.branch(options))
    session.go_to(0)
    while session.moment < len(session.trace):
        session.step()
    assert session.finished
    assert session.progress == 1


def planned_otherwise() -> FairingOptions:
    return replace(planned(), locked_vertices=(3,))


def test_a_branch_under_other_options_begins_its_sweep_anew_and_is_planned_again():
    session = Session(corner_scene(), small_options(schedule={"order": "sequential", **QUICK}))
    for _ in range(4):
        session.step()
    assert session.position[2:] != (0, 0)
    same = session.branch(replace(session.options, threads=2))
    assert (same.position, same.plan) == (session.position, session.plan)
    other = session.branch(replace(session.options, locked_vertices=(2,)))
    assert other.plan is None
    assert other.position == session.position._replace(block=0, iteration=0)
    assert 0 <= other.progress <= session.progress
    other.step()
    assert other.plan is not None


def test_the_plan_is_recorded_and_a_resumed_run_does_not_compute_it_again(tmp_path, monkeypatch: pytest.MonkeyPatch):
    session = Session(rough_scene(), planned())
    session.trace.attach(tmp_path / "run.trace")
    plan = session.make_plan()
    assert plan.is_smoothed
    assert session.make_plan() is plan
    session.step()
    session.trace.detach()
    loaded = Trace.load(tmp_path / "run.trace")
    assert (loaded.plan, len(loaded)) == (plan, 1)
    monkeypatch.setattr("fairing.run.session.make_plan", None)
    resumed = Session(rough_scene(), trace=loaded)
    resumed.run()
    session.run()
    assert np.array_equal(resumed.vertices, session.vertices)


def test_a_trace_without_a_plan_is_planned_again_to_the_same_end(tmp_path):
    """As recorded by versions without plans."""
    whole = Session(rough_scene(), planned())
    whole.run()
    part = whole.trace.cut(3)
    part.plan = None
    part.attach(tmp_path / "old.trace")
    part.detach()
    resumed = Session(rough_scene(), trace=Trace.load(tmp_path / "old.trace"))
    assert resumed.plan is None
    assert 0 <= resumed.progress < 1
    assert resumed.position == whole.trace.steps[2].next_position
    resumed.run()
    assert resumed.plan == whole.plan
    assert np.array_equal(resumed.vertices, whole.vertices)


def test_the_position_at_the_start_is_that_of_the_first_step():
    options = small_options(schedule={"first_level": "auto", "blur": [9.0, 2.0, 0.8], **QUICK})
    session = Session(corner_scene(), options)
    assert session.position.level == 0
    plan = session.make_plan()
    assert session.position.level == plan.first_level == 1
    record = session.step()
    assert record is not None
    assert record.position.level == 1
    session.go_to(0)
    assert session.position == record.position


def test_cancelled_planning_changes_nothing():
    """Cancelled at its n-th request, for several n, until it is complete."""
    expected = Session(rough_scene(), planned()).make_plan()
    session, allowed, cancelled = Session(rough_scene(), planned()), 1, 0
    before = everything_shown(session)[:5]
    while session.plan is None:
        remaining = iter(range(allowed))
        session.cancel_requested = lambda remaining=remaining: next(remaining, None) is None
        try:
            session.make_plan()
        except Cancelled:
            cancelled += 1
            assert everything_shown(session)[:5] == before
            assert len(session.trace) == 0
        allowed *= 2
    assert cancelled > 4
    assert session.plan == expected


def test_a_run_in_which_everything_is_locked_says_that_no_vertex_could_move():
    for preset in ("accurate", "paper"):
        session = Session(corner_scene(), small_options(preset, locked_vertices=tuple(range(7)), schedule=QUICK))
        reason = session.run()
        assert reason == "finished: no vertex could move: 7 of 7 vertices are locked; unlock some"
        assert np.array_equal(session.vertices, session.trace.start)


@pytest.mark.parametrize("order", ["joint", "independent", "sequential", "worst_first"])
def test_locking_all_vertices_within_a_sweep_leaves_a_progress_and_an_end(order: str):
    session = Session(
        corner_scene(), small_options(schedule={"order": order, "max_sweeps": [2], "max_iterations": [3]})
    )
    session.step_sweep()
    session.step()
    assert session.position[2:] != (0, 0)
    branch = session.branch(replace(session.options, locked_vertices=tuple(range(7))))
    assert 0 <= branch.progress < 1
    while not branch.finished:
        branch.step()
        assert 0 <= branch.progress <= 1
    assert np.array_equal(branch.vertices, session.vertices)
    assert branch.stop_reason.startswith("finished")


@pytest.mark.slow
def test_progress_never_falls_during_a_run():
    for order in ("joint", "independent", "sequential"):
        session = Session(rough_scene(), rough_options(schedule={"order": order, **QUICK}))
        session.make_plan()
        fractions = [session.progress]
        while not session.finished:
            session.step()
            fractions.append(session.progress)
        assert fractions == sorted(fractions)
        assert fractions[-1] == 1


def test_a_plan_survives_json():
    plan = RunPlan(2, True, False, 3.25)
    assert RunPlan.from_json(plan.to_json()) == plan


@pytest.mark.parametrize(
    "changes",
    [
        {"first_level": -1}, {"first_level": 1.5}, {"first_level": True}, {"is_smoothed": 1}, {"start_sigma": -1.0},
        {"start_sigma": float("inf")}, {"start_sigma": float("nan")}, {"start_sigma": "3"}, {"unknown": 1},
    ],
)  # fmt: skip
def test_a_plan_with_impossible_values_is_refused(changes: dict):
    values = json.loads(RunPlan(2, True, False, 3.25).to_json()) | changes
    with pytest.raises(InputError, match="run plan"):
        RunPlan.from_json(json.dumps(values))
    with pytest.raises(InputError, match="run plan"):
        RunPlan.from_json("[" * 100_000)


def test_a_plan_of_another_version_names_the_field_that_is_not_known():
    values = json.loads(RunPlan(2, True, False, 3.25).to_json()) | {"takes_all_points": True}
    with pytest.raises(InputError, match="expected no field takes_all_points; open the run with the version"):
        RunPlan.from_json(json.dumps(values))


def test_former_fields_of_plans_in_old_traces_are_ignored():
    values = json.loads(RunPlan(2, True, False, 3.25).to_json()) | {"start_error": 7.0, "is_near_truth": True}
    assert RunPlan.from_json(json.dumps(values)) == RunPlan(2, True, False, 3.25)


def test_former_options_in_old_traces_are_ignored():
    values = options_to_dict(small_options())
    values["step"] |= {"prior": 0.1, "prior_threshold": 0.15, "normal_spread": 0.01}
    values["eigenspace"] |= {"significance": [0.0, 6.0]}
    values["schedule"] |= {"search": [1.0], "start_error": 3.0, "search_gain": 0.05, "sweeps_near_truth": [1]}
    assert options_from_dict(values) == small_options()


def test_the_former_name_of_the_first_level_is_read_from_old_traces():
    values = options_to_dict(small_options(schedule={"first_level": "first"}))
    values["schedule"]["start"] = values["schedule"].pop("first_level")
    assert options_from_dict(values) == small_options(schedule={"first_level": "first"})
