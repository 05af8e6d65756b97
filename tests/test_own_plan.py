"""Plans of one's own: equal to the same parts of a default run bit by bit, recorded, and their mistakes told in one line."""

from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np
import pytest

import fairing
import fairing.run.recorded_stages as recorded_stages_module
from app.debugger.history import EnergyHistory
from demo_scenes.building.scene import scene_of_plan
from fairing.errors import InputError
from fairing.run.phases import schedule_of
from fairing.run.recorded_stages import recorded_stages
from fairing.run.session import Session
from fairing.run_plan import PlanStage, RunPlan
from fairing.stage_kind import StageKind
from fairing.trace import Trace
from tests.prior_to_start import origin_of
from tests.rough_scene import rough_options, rough_scene
from tests.small_building import small_building
from tests.small_scene import corner_scene, small_options
from tests.two_levels import two_levels

FIT = [
    PlanStage("points"),
    PlanStage("judge", by="points"),
    PlanStage("axes"),
    PlanStage("surface points"),
    PlanStage("axes"),
    PlanStage("surface points"),
    PlanStage("axes"),
    PlanStage("closest points"),
    PlanStage("axes", max_sweeps=4, is_broad=True),
    PlanStage("closest points", max_sweeps=1),
    PlanStage("axes", max_sweeps=4, is_broad=True),
    PlanStage("judge"),
]
"""The fit of a default run to points whose photos are known."""


class Recorded(NamedTuple):
    """What an energy history reads of a run."""

    run_id: int
    trace: Trace
    length: int


def stages_of(session: Session) -> list[tuple[StageKind, int]]:
    return [(stage.kind, stage.end - stage.begin) for stage in recorded_stages(session.trace)]


@pytest.mark.compiled
@pytest.mark.parametrize("order", ["joint", "sequential"])
def test_one_stage_of_photos_is_the_beginning_of_a_default_run(order: Literal["joint", "sequential"]):
    options = two_levels(order, sweeps=2, iterations=2)
    default = Session(corner_scene(), options)
    default.step_level()
    plan = [PlanStage("photos", blur=options.levels[0].blur)]
    own = fairing.fair(corner_scene(), options, plan=plan)
    assert own.finished
    assert own.options.by_level("blur") == (options.levels[0].blur,)
    assert len(own.trace) == len(default.trace)
    assert own.vertices.tobytes() == default.vertices.tobytes()
    both = fairing.fair(corner_scene(), options, plan=[PlanStage("photos", blur=each.blur) for each in options.levels])
    default.run()
    is_judged = default.trace.steps[-1].stage is StageKind.JUDGE
    moment = len(default.trace) - is_judged
    assert both.vertices.tobytes() == default.trace.vertices_at(moment).tobytes()


@pytest.mark.compiled
@pytest.mark.slow
def test_the_fit_of_a_default_run_as_a_plan_is_the_same_fit():
    default = Session(replace(scene_of_plan("building small", small_building()), truth=None))
    default.make_plan()
    while default.next_stage is not StageKind.PHOTOS:
        default.step()
    kinds = {kind for kind, _ in stages_of(default)}
    assert {StageKind.POINTS, StageKind.AXES, StageKind.CLOSEST_POINTS} <= kinds
    begins = [PlanStage("smoothing"), PlanStage("judge")] if StageKind.SMOOTHNESS in kinds else []
    # A default run seeks no points near a start that is accurate.
    fit = FIT if StageKind.SURFACE_POINTS in kinds else FIT[:3] + FIT[7:]
    own = fairing.fair(default.scene, plan=[*begins, *fit])
    assert stages_of(own) == stages_of(default)
    assert own.vertices.tobytes() == default.vertices.tobytes()
    assert own.stop_reason.startswith("finished: all 1 levels done")


@pytest.mark.compiled
def test_smoothing_comes_wherever_the_plan_has_it_and_without_a_judge_it_stays():
    options = rough_options()
    plan = [PlanStage("photos", blur=2.0), PlanStage("smoothing", max_iterations=2), PlanStage("photos", blur=1.0)]
    session = fairing.fair(rough_scene(), options, plan=plan)
    kinds = stages_of(session)
    assert [kind for kind, _ in kinds] == [StageKind.PHOTOS, StageKind.SMOOTHNESS, StageKind.PHOTOS]
    assert kinds[1][1] == 2
    assert session.progress == 1.0
    begin = kinds[0][1] + 2
    sweep = session.sweep_state(begin)
    assert np.array_equal(origin_of(sweep), session.trace.vertices_at(begin)), "the prior is to the smoothed vertices"
    alone = fairing.fair(rough_scene(), options, plan=[PlanStage("smoothing")])
    assert stages_of(alone) == [(StageKind.SMOOTHNESS, 5)]
    assert (alone.vertices != alone.trace.start).any()
    assert (
        alone.stop_reason
        == f"finished: all 1 levels done, {len(alone.vertices)} of {len(alone.vertices)} vertices moved"
    )
    assert alone.sweep_state().context.takes_part.any()


@pytest.mark.compiled
def test_a_judge_sends_smoothing_back_that_the_photos_do_not_want():
    plan = [PlanStage("smoothing"), PlanStage("judge"), PlanStage("photos"), PlanStage("judge", by="end")]
    session = fairing.fair(corner_scene(), two_levels("joint", sweeps=2, iterations=2), plan=plan)
    kinds = [kind for kind, _ in stages_of(session)]
    assert kinds == [StageKind.SMOOTHNESS, StageKind.JUDGE, StageKind.PHOTOS, StageKind.JUDGE]
    verdict = stages_of(session)[0][1] + 1
    assert np.array_equal(session.trace.vertices_at(verdict), session.trace.start)


@pytest.mark.compiled
def test_settings_are_those_of_the_stage():
    options = two_levels("joint", sweeps=2, iterations=2)
    plan = [PlanStage("photos", blur=1.5, max_sweeps=1, max_iterations=2, dimensions=2, creases=0.5)]
    session = Session(corner_scene(), options, plan=plan)
    session.step()
    assert session.options.levels[0] == replace(
        options.levels[1 if abs(options.levels[1].blur - 1.5) < abs(options.levels[0].blur - 1.5) else 0],
        blur=1.5, max_sweeps=1, max_iterations=2, dimensions=2, creases=0.5, smoothing=0.0, points=0.0,
    )  # fmt: skip
    session.run()
    assert 1 <= len(session.trace) <= 2


@pytest.mark.compiled
def test_a_plan_is_resumed_branched_and_replayed(tmp_path):
    plan = [PlanStage("photos", blur=3.0), PlanStage("smoothing"), PlanStage("judge"), PlanStage("photos", blur=1.0)]
    options = two_levels("joint", sweeps=2, iterations=2)
    whole = fairing.fair(corner_scene(), options, plan=plan)
    for stop in (0, 1, len(whole.trace) // 2):
        begun = Session(corner_scene(), options, plan=plan)
        for _ in range(stop):
            begun.step()
        begun.trace.attach(tmp_path / "run.trace")
        begun.trace.detach()
        again = Session(corner_scene(), trace=Trace.load(tmp_path / "run.trace"))
        again.run()
        assert again.vertices.tobytes() == whole.vertices.tobytes()
        assert again.plan == whole.plan
        assert again.plan is not None
        assert again.plan.stages == tuple(plan)
    assert Session(corner_scene(), trace=whole.trace, plan=plan).finished
    with pytest.raises(InputError, match="recorded with another plan"):
        Session(corner_scene(), trace=whole.trace, plan=plan[:1])
    whole.go_to(len(whole.trace) // 2)
    branch = whole.branch()
    branch.run()
    whole.go_to(len(whole.trace))
    assert branch.vertices.tobytes() == whole.vertices.tobytes()
    whole.go_to(1)
    other = whole.branch(replace(whole.options, robust=replace(whole.options.robust, norm="huber")))
    other.run()
    assert [kind for kind, _ in stages_of(other)] == [kind for kind, _ in stages_of(whole)]
    whole.go_to(0)
    usual, default = whole.branch(options), Session(corner_scene(), options)
    assert whole.branch(replace(whole.options, levels=whole.options.levels * 2)).make_plan().stages == ()
    for run in (usual, default):
        run.run()
    assert usual.plan is not None
    assert usual.plan.stages == tuple(plan), "as many levels"


FORMER = [
    PlanStage("photos", blur=3.6, max_sweeps=2),
    PlanStage("smoothing", max_iterations=3),
    PlanStage("judge"),
    PlanStage("photos", blur=1.2),
]


@pytest.mark.compiled
def test_the_schedule_of_a_recorded_plan_is_made_once_for_each_trace(monkeypatch):
    made = []
    monkeypatch.setattr(recorded_stages_module, "schedule_of", lambda *facts: made.append(facts) or schedule_of(*facts))
    options = two_levels("joint", sweeps=1, iterations=1)
    session = fairing.fair(corner_scene(), options, plan=[PlanStage("photos", blur=2.0), PlanStage("photos", blur=1.0)])
    stages, history = recorded_stages(session.trace), EnergyHistory(len(session.trace.faces))
    for length in range(1, len(session.trace) + 1):
        history.update(Recorded(1, session.trace, length))
    assert [stage.begin for stage in history.stages(len(session.trace))] == [stage.begin for stage in stages] == [0, 1]
    assert len(made) == 1
    branch = session.branch(plan=[PlanStage("photos", blur=2.0), PlanStage("smoothing"), PlanStage("photos", blur=1.0)])
    branch.run()
    assert len(recorded_stages(branch.trace)) == 3
    assert len(made) == 2


CHANGES: dict[str, tuple[list[PlanStage], int]] = {
    "the first": ([PlanStage("photos", blur=3.6, max_sweeps=1), *FORMER[1:]], 0),
    "smoothing": ([FORMER[0], PlanStage("smoothing", max_iterations=1), *FORMER[2:]], 1),
    "photos that judge": ([*FORMER[:3], PlanStage("photos", blur=1.0)], 2),
    "no judge": ([*FORMER[:2], FORMER[3]], 2),
    "the last": ([*FORMER[:3], PlanStage("photos", blur=1.2, max_sweeps=1, max_iterations=1)], 3),
    "one more": ([*FORMER, PlanStage("photos", blur=0.6, max_sweeps=1)], 4),
}
"""Changed plans with the number of stages that stay."""


@pytest.mark.compiled
@pytest.mark.parametrize(("plan", "unchanged"), CHANGES.values(), ids=CHANGES.keys())
def test_a_changed_plan_keeps_the_stages_before_the_change_and_ends_like_a_new_run(plan, unchanged):
    options = rough_options()
    former = fairing.fair(rough_scene(), options, plan=FORMER)
    begins = [stage.begin for stage in recorded_stages(former.trace)] + [len(former.trace)]
    wanted = fairing.fair(rough_scene(), options, plan=plan)
    for moment in (0, 1, begins[2], len(former.trace)):
        former.go_to(moment)
        branch = former.branch(plan=plan)
        assert branch.moment == min(moment, begins[unchanged])
        branch.run()
        assert branch.own_plan == tuple(plan)
        assert branch.options == wanted.options
        assert branch.vertices.tobytes() == wanted.vertices.tobytes()
        assert [step.position for step in branch.trace.steps] == [step.position for step in wanted.trace.steps]


@pytest.mark.compiled
def test_a_plan_that_replaces_none_begins_at_the_start_and_settings_left_out_are_as_before_the_first_plan(tmp_path):
    options = two_levels("joint", sweeps=2, iterations=2)
    usual = fairing.fair(corner_scene(), options)
    plan = [PlanStage("photos", blur=2.0, max_sweeps=1)]
    first = usual.branch(plan=plan)
    assert first.moment == 0
    first.trace.attach(tmp_path / "run.trace")
    first.trace.detach()
    again = Session(corner_scene(), trace=Trace.load(tmp_path / "run.trace"))
    for run in (first, again):
        assert run.branch(plan=[PlanStage("photos", blur=2.0)]).options.levels[0].max_sweeps == 2
    of_former_version = again.trace
    del of_former_version.header["options_before_own_plan"]
    plain = Session(corner_scene(), trace=of_former_version).branch(plan=[PlanStage("photos", blur=2.0)])
    assert plain.options.levels == Session(corner_scene(), plan=[PlanStage("photos", blur=2.0)]).options.levels


@pytest.mark.compiled
def test_a_changed_plan_that_makes_no_sense_leaves_the_run_as_it_is():
    session = fairing.fair(corner_scene(), two_levels("joint", sweeps=1, iterations=1), plan=[PHOTOS])
    for plan, message in (
        ([PHOTOS, PlanStage("points")], "stage 2, points: expected sparse points"),
        ([], "found \\[\\]"),
    ):
        with pytest.raises(InputError, match=message):
            session.branch(plan=plan)
    assert session.finished
    assert session.own_plan == (PHOTOS,)


@pytest.mark.compiled
def test_a_plan_does_not_depend_on_the_number_of_threads():
    plan = [PlanStage("photos", blur=2.0), PlanStage("smoothing"), PlanStage("photos", blur=1.0)]
    runs = [fairing.fair(rough_scene(), rough_options(threads=threads), plan=plan) for threads in (1, 3)]
    assert runs[0].vertices.tobytes() == runs[1].vertices.tobytes()


def test_plans_are_recorded_as_json():
    plan = RunPlan(0, True, False, records_fit=True, stages=(PlanStage("points", gates=[1, 0.5]), PlanStage("judge")))
    assert RunPlan.from_json(plan.to_json()) == plan
    assert plan.stages[0].settings == {"gates": (1, 0.5)}


PHOTOS = PlanStage("photos")
MISTAKES = [
    ([], r"plan: expected a list of fairing.PlanStage, found \[\]"),
    (PHOTOS, "plan: expected a list of fairing.PlanStage, found PlanStage"),
    (["photos"], "plan: stage 1: expected a fairing.PlanStage, found str"),
    ([PlanStage("foto")], "plan: stage 1: expected one of photos, smoothing, .*; found 'foto'"),
    ([PlanStage(["photos"])], r"plan: stage 1: expected one of photos, .*; found \['photos'\]"),  # pyright: ignore
    ([PHOTOS, PlanStage("photos", blurr=1)], "plan: stage 2, photos: expected settings among blur, .*; found blurr"),
    ([PlanStage("photos", blur=[1, 2])], r"plan: stage 1, photos: expected one value of blur, found \(1, 2\)"),
    ([PlanStage("photos", blur="1")], "option schedule.blur: expected a value of type float, found '1'"),
    ([PlanStage("photos", max_sweeps=0)], "option schedule.max_sweeps: expected at least 1, found 0"),
    ([PlanStage("points", gates=[])], r"plan: stage 1, points: expected gates as a list of numbers .*, found \(\)"),
    ([PlanStage("points", gates=(1, -1))], r"expected gates as a list of numbers of percent above 0, found \(1, -1\)"),
    ([PlanStage("points", gates=2.0)], "expected gates as a list of numbers of percent above 0, found 2.0"),
    ([PlanStage("smoothing", max_iterations=1.5)], "max_iterations as a whole number from 1 to 1000, found 1.5"),
    ([PlanStage("axes", is_broad=1)], "expected is_broad as True or False, found 1"),
    ([PlanStage("judge")], "plan: stage 1, judge: expected smoothing or a fit before it, found none to judge"),
    ([PlanStage("smoothing"), PHOTOS, PlanStage("judge")], "stage 3, judge: expected smoothing or a fit before it"),
    ([PlanStage("judge", by="end"), PHOTOS], "expected the judge of the end as the last stage"),
    ([PlanStage("smoothing"), PlanStage("judge", by="me")], "expected by as one of points, photos, end; found 'me'"),
]


@pytest.mark.parametrize(("plan", "message"), MISTAKES, ids=[str(k) for k in range(len(MISTAKES))])
def test_a_wrong_plan_is_refused_in_one_line(plan: list, message: str):
    with pytest.raises(InputError, match=message) as caught:
        Session(corner_scene(), small_options(), plan=plan)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "stage",
    [PlanStage("points"), PlanStage("surface points"), PlanStage("closest points"), PlanStage("axes", is_broad=True)],
    ids=lambda stage: stage.kind,
)
def test_a_fit_without_points_is_refused(stage: PlanStage):
    with pytest.raises(
        InputError, match=f"plan: stage 2, {stage.kind}: expected sparse points.*, found none in corner"
    ):
        Session(corner_scene(), small_options(), plan=[PHOTOS, stage]).make_plan()


@pytest.mark.parametrize(
    "found", [3, [3], [{"kind": "photos"}], [{"kind": "x", "settings": {}}], [{"kind": 1, "settings": 2}]]
)
def test_recorded_plans_that_make_no_sense_are_refused(found: object):
    session = Session(corner_scene(), small_options())
    session.trace.header["own_plan"] = found
    with pytest.raises(InputError, match="plan"):
        Session(corner_scene(), trace=session.trace)
    with pytest.raises(InputError, match="plan"):
        RunPlan.from_json('{"first_level": 0, "is_smoothed": false, "is_fitted_to_points": false, "stages": [3]}')
    del session.trace.header["own_plan"]
    session.trace.plan = RunPlan(0, False, False, stages=(PlanStage("nothing"),))
    with pytest.raises(InputError, match="expected the stages of own_plan in its plan, found others"):
        Session(corner_scene(), trace=session.trace)
