"""The second fit to the sparse points at the end of a run: accepted, rejected, or taken back, on a small building with points."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from demo_scenes.building.scene import scene_of_plan
from fairing.judge.report import run_report, sweep_energies
from fairing.options import PRESETS
from fairing.run.phases import GaussNewton, SecondFit, schedule_of
from fairing.run.session import Session
from fairing.run_plan import RunPlan
from fairing.scene import Scene
from fairing.solve.energy import robust_scale
from fairing.trace import StepReason, Trace
from tests.small_building import small_building
from tests.small_scene import corner_scene, observed, on_the_faces, small_options

# By the error of the start, px: the photos accept the fit and the mesh is better after it; not better; they reject the fit.
KEPT, TAKEN_BACK, REJECTED = 2.5, 4.0, 3.0


def building(start_px: float) -> Scene:
    return scene_of_plan("building with points", replace(small_building(), has_points=True, start_px=start_px))


def whole_run(start_px: float) -> Session:
    session = Session(building(start_px))
    session.run()
    return session


@pytest.fixture(scope="module")
def kept() -> Session:
    return whole_run(KEPT)


@pytest.fixture(scope="module")
def taken_back() -> Session:
    return whole_run(TAKEN_BACK)


@pytest.fixture(scope="module")
def rejected() -> Session:
    return whole_run(REJECTED)


def second_fit(session: Session) -> int:
    """The moment before the only second fit of a run."""
    moments = [moment for moment, record in enumerate(session.trace.steps) if record.is_second_fit]
    assert len(moments) == 1
    return moments[0]


def energy_by_last_sweep(session: Session, vertices: np.ndarray) -> float:
    sweep = session.sweep_state()
    scale = robust_scale(session.options.robust, sweep.sigma)
    return float(session._problem.energies(sweep.context, vertices, scale).energy.sum())


@pytest.mark.slow
def test_a_fit_that_lowers_the_photo_loss_is_taken_and_followed(kept):
    moment, trace = second_fit(kept), kept.trace
    record = trace.steps[moment]
    assert (record.reasons == StepReason.FITTED_AGAIN).all()
    assert record.objective_after < record.objective_before
    assert record.accepted
    assert (kept.vertices != trace.vertices_at(moment)).any()
    assert np.array_equal(trace.origin_at(len(trace)), trace.vertices_at(moment + 1))
    later = kept.sweep_state(moment + 1)
    assert isinstance(later.phase, GaussNewton)
    assert later.near_points is not kept.sweep_state(moment - 1).near_points
    assert energy_by_last_sweep(kept, kept.vertices) <= energy_by_last_sweep(kept, trace.vertices_at(moment))


@pytest.mark.slow
def test_a_fit_that_the_photos_reject_ends_the_run(rejected):
    moment, trace = second_fit(rejected), rejected.trace
    record = trace.steps[moment]
    assert moment == len(trace) - 1
    assert (record.reasons == StepReason.REJECTED_FIT).all()
    assert record.objective_after >= record.objective_before
    assert not record.accepted
    assert np.array_equal(rejected.vertices, trace.vertices_at(moment))
    assert rejected.stop_reason.startswith("finished: all 5 levels done")


@pytest.mark.slow
def test_a_fit_that_does_not_improve_the_mesh_is_taken_back(taken_back):
    moment, trace = second_fit(taken_back), taken_back.trace
    assert (trace.steps[moment].reasons == StepReason.FITTED_AGAIN).all()
    assert (trace.steps[-1].reasons == StepReason.RETURNED).all()
    assert np.array_equal(taken_back.vertices, trace.vertices_at(moment))
    assert "before the second fit" in taken_back.stop_reason


@pytest.mark.slow
def test_a_run_resumed_after_its_second_fit_ends_alike_to_the_bit(kept, tmp_path: Path):
    part = kept.trace.cut(second_fit(kept) + 2)
    part.attach(tmp_path / "run.trace")
    part.detach()
    resumed = Session(kept.scene, trace=Trace.load(tmp_path / "run.trace"))
    resumed.run()
    assert np.array_equal(resumed.vertices, kept.vertices)


@pytest.mark.slow
def test_the_points_of_a_sweep_are_those_of_the_fit_before_it(kept):
    """In whatever order sweeps are asked for, as when a user moves back and forth."""
    moment = second_fit(kept)
    other = Session(kept.scene, trace=kept.trace.cut(len(kept.trace)))
    for at in (moment + 1, 2, moment + 1):
        found, expected = other.sweep_state(at).near_points, kept.sweep_state(at).near_points
        assert found is not None
        assert expected is not None
        assert np.array_equal(found.positions, expected.positions)


@pytest.mark.slow
@pytest.mark.parametrize("before", [4, 0])
def test_a_run_with_manual_edits_is_not_fitted_again(kept, before):
    """Made `before` steps ahead of the second fit; the sweeps of the last level go on from there."""
    session = Session(kept.scene, trace=kept.trace.cut(second_fit(kept) - before))
    session.place(np.array([5]), session.vertices[[5]] + 1e-3)
    placed = session.vertices
    session.run()
    assert session.finished
    assert (session.vertices != placed).any()
    assert not any(record.is_second_fit for record in session.trace.steps)


@pytest.mark.slow
def test_energies_of_sweeps_leave_the_second_fit_out(kept):
    position = kept.trace.steps[second_fit(kept)].position
    energies = sweep_energies(kept.trace)
    assert (position.level, position.sweep) not in {(sweep.level, sweep.sweep) for sweep in energies}
    assert {sweep.sweep for sweep in energies} > {position.sweep - 1, position.sweep + 1}


@pytest.mark.slow
def test_the_report_names_the_outcome(kept, rejected):
    assert run_report(kept, "accurate", {}, {})["second_fit"] == "fitted_again"
    assert run_report(rejected, "accurate", {}, {})["second_fit"] == "rejected_fit"
    before = Session(kept.scene, trace=kept.trace.cut(second_fit(kept)))
    assert run_report(before, "accurate", {}, {})["second_fit"] is None


def test_a_second_fit_is_followed_by_the_sweeps_of_a_fitted_start():
    plan = RunPlan(4, False, False, 0.0, True, start_sigma=1.5, represents_surface=True, has_second_fit=True)
    level = schedule_of(PRESETS["accurate"], plan).levels[-1]
    first, fit, second = level.phases
    assert isinstance(first, GaussNewton)
    assert isinstance(fit, SecondFit)
    assert isinstance(second, GaussNewton)
    before, after = level.at(first.max_sweeps), level.at(first.max_sweeps + 1)
    assert before is level
    assert (before.attraction, before.start_sigma > 0) == (0, True)
    assert (after.attraction > 0, after.start_sigma) == (True, 0)


def test_a_mesh_without_the_axes_of_a_building_or_without_points_has_no_second_fit():
    plan = Session(
        observed(corner_scene((0.3, -0.2, 0.25)), on_the_faces(600)), small_options(step={"points": [0.3]})
    ).make_plan()
    assert plan.represents_surface
    assert not plan.has_second_fit
    assert not Session(replace(building(REJECTED), sparse_points=None)).make_plan().has_second_fit
