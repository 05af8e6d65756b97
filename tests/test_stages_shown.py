"""Stages of a run as the debugger steps over them, names them and draws them."""

import base64
import itertools
import re
import zlib
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from app.debugger.commands import Back, Extent, Forward, JumpTo, Run, ToBeginning
from app.debugger.controller import Controller
from app.debugger.history import EnergyHistory
from app.debugger.moment_pulls import moment_pulls
from app.debugger.quantities import parse_step_condition, quantities_of
from app.debugger.stage_text import fit_lines, stage_line
from app.export.page_data import run_data
from app.export.page_pulls import MOST_MOMENTS, pull_moments, pulls_of_run
from app.export.run_facts import RunFacts
from app.export.step_kinds import KINDS
from app.palette import STAGE_COLORS
from app.panels.stage_band import stage_band
from app.pictures.stage_colors import stage_ground
from app.pictures.strip import StepHistory
from fairing.judge.report import run_report, sweep_energies
from fairing.run.recorded_stages import RecordedStage, recorded_stages
from fairing.run.session import Session
from fairing.run_plan import PlanStage
from fairing.scene import Scene
from fairing.stage_kind import StageKind
from fairing.trace import Trace
from tests.color_vision import BLINDNESS, in_cielab
from tests.commands import do
from tests.small_scene import corner_scene, small_options
from tests.staged_run import AGAIN, FITS, staged_trace

OPTIONS = small_options(schedule={"order": "joint", "max_sweeps": [2], "max_iterations": [3]})


@pytest.fixture(scope="module")
def scene() -> Scene:
    return corner_scene()


@pytest.fixture(scope="module")
def by_photos(scene: Scene) -> Session:
    session = Session(scene, OPTIONS)
    session.run()
    return session


@pytest.fixture(scope="module")
def trace(by_photos: Session) -> Trace:
    return staged_trace(by_photos)


@pytest.fixture(scope="module")
def stages(trace: Trace) -> list[RecordedStage]:
    return recorded_stages(trace)


@pytest.fixture
def controller(scene: Scene, trace: Trace):
    controller = Controller(Session(scene, trace=trace.cut(len(trace))))
    yield controller
    controller.close()


def history_of(trace: Trace, *lengths: int) -> EnergyHistory:
    history = EnergyHistory(len(trace.faces))
    for length in lengths or (len(trace),):
        history.update(SimpleNamespace(run_id=1, trace=trace, length=length))
    return history


def progress_lines(trace: Trace, length: int | None = None) -> list[str]:
    history, length = history_of(trace), length or len(trace)
    return [stage_line(step, history.stage_progress(k, length), OPTIONS) for k, step in enumerate(trace.steps[:length])]


def test_the_history_has_the_stages_of_the_record_however_it_is_read(trace: Trace, stages: list[RecordedStage]):
    assert [stage.kind for stage in stages[: len(FITS)]] == [kind for kind, _, _ in FITS]
    for lengths in ((len(trace),), (3, 41, len(trace))):
        assert history_of(trace, *lengths).stages(len(trace)) == stages
    assert history_of(trace).stages(10) == [RecordedStage(StageKind.POINTS, stages[0].level, 0, 10)]


def test_steps_over_stages_stop_where_the_next_one_begins(controller: Controller, stages: list[RecordedStage]):
    do(controller, JumpTo(0))
    ends = [do(controller, Forward(Extent.STAGE)).moment for _ in stages]
    assert ends == [stage.end for stage in stages]
    begins = [do(controller, Back(Extent.STAGE)).moment for _ in stages]
    assert begins == [stage.begin for stage in reversed(stages)]


def test_from_within_a_stage_one_steps_to_its_ends(controller: Controller, stages: list[RecordedStage]):
    within = stages[0].begin + 7
    assert do(controller, JumpTo(within), Back(Extent.STAGE)).moment == stages[0].begin
    assert do(controller, JumpTo(within), ToBeginning(Extent.STAGE)).moment == stages[0].begin
    assert do(controller, JumpTo(within), Forward(Extent.STAGE)).moment == stages[0].end
    # At a boundary the next step counts for the beginning, the last one for a step back.
    assert do(controller, JumpTo(stages[2].begin), ToBeginning(Extent.STAGE)).moment == stages[2].begin
    assert do(controller, JumpTo(stages[2].begin), Back(Extent.STAGE)).moment == stages[1].begin


def test_stages_of_one_kind_after_each_other_in_a_plan_are_shown_and_stepped_each_for_itself(scene: Scene):
    plan = [PlanStage("smoothing", max_iterations=n) for n in (2, 1)] + [PlanStage("photos", blur=1.0, max_sweeps=1)]
    session = Session(scene, OPTIONS, plan=plan)
    controller = Controller(session)
    ends = [do(controller, Forward(Extent.STAGE)).moment for _ in plan]
    assert controller.state.finished
    assert ends[:2] == [2, 3]
    assert [do(controller, Back(Extent.STAGE)).moment for _ in plan] == [3, 2, 0]
    controller.close()
    found = recorded_stages(session.trace)
    assert [(stage.kind.label, stage.end) for stage in found] == list(zip([s.kind for s in plan], ends, strict=True))
    for lengths in ((len(session.trace),), (1, 3, len(session.trace))):
        assert history_of(session.trace, *lengths).stages(len(session.trace)) == found
    band = stage_band(found, session.options, len(session.trace), 1, str)
    assert re.findall(r"listitem' aria-label='(.*?)' title", band) == ["smoothing", "smoothing", "photos 1 px"]
    again = Session(scene, trace=session.trace)
    again.go_to(0)
    for end in ends:
        again.step_stage()
        assert again.moment == end


def test_a_session_steps_over_stages_of_a_record_and_of_a_new_run_alike(
    scene: Scene, by_photos: Session, trace: Trace, stages: list[RecordedStage]
):
    recorded = Session(scene, trace=trace)
    recorded.go_to(0)
    for stage in stages:
        last = recorded.step_stage()
        assert recorded.moment == stage.end
        assert last is trace.steps[stage.end - 1]
    assert recorded.step_stage() is None
    new = Session(scene, OPTIONS)
    for stage in recorded_stages(by_photos.trace):
        new.step_stage()
        assert new.moment == len(new.trace) == stage.end


def test_the_next_stage_is_known_before_its_first_step(scene: Scene, trace: Trace):
    session = Session(scene, trace=trace)
    assert session.next_stage is None
    for moment, step in enumerate(trace.steps):
        session.go_to(moment)
        assert session.next_stage is step.stage
    new = Session(scene, OPTIONS)
    assert new.next_stage is None, "a property computes no plan"
    new.make_plan()
    assert new.next_stage is StageKind.PHOTOS


def test_a_run_stops_where_a_stage_of_a_kind_begins(controller: Controller, stages: list[RecordedStage]):
    judge = next(stage for stage in stages if stage.kind is StageKind.JUDGE)
    until = parse_step_condition("stage(judge) and accepted > 0")
    assert do(controller, JumpTo(0), Run(until)).moment == judge.begin + 1
    step = controller.state.trace.steps[judge.begin]
    assert parse_step_condition("stage(judge)").holds(quantities_of(step, judge.end))
    assert not parse_step_condition("stage(surface_points)").holds(quantities_of(step, judge.end))


def test_a_fit_has_no_energy_for_conditions(trace: Trace):
    assert not parse_step_condition("energy >= 0").holds(quantities_of(trace.steps[0], 1))
    photos = next(k for k, step in enumerate(trace.steps) if step.stage is StageKind.PHOTOS)
    assert parse_step_condition("energy >= 0").holds(quantities_of(trace.steps[photos], photos + 1))


def test_a_line_says_what_goes_on_in_the_stage(trace: Trace, stages: list[RecordedStage]):
    lines = progress_lines(trace)
    assert lines[:3] == ["points · gate 1 of 20", "points · gate 1 of 20, iteration 2", "points · gate 2 of 20"]
    assert lines[stages[0].end - 1] == "points · gate 20 of 20, iteration 2"
    assert lines[stages[1].begin] == "judge · 4 vertices go back"
    assert [lines[stages[2].begin + k] for k in range(2)] == ["axes · iteration 1", "axes · iteration 2"]
    assert lines[stages[3].end - 1] == "surface points · sweep 2 of 2, iteration 8"
    photos = next(stage for stage in stages if stage.kind is StageKind.PHOTOS)
    blur = OPTIONS.levels[photos.level].blur
    assert lines[photos.begin] == f"photos {blur:g} px · sweep 1, iteration 1"
    assert progress_lines(trace, 5)[-1] == "points · gate 3", (
        "how many gates there are is known at the end of the stage"
    )
    step = replace(trace.steps[stages[1].begin], after=trace.steps[stages[1].begin].before)
    progress = history_of(trace).stage_progress(stages[1].begin, len(trace))
    assert stage_line(step, progress, OPTIONS) == "judge · nothing goes back"


def test_sweeps_of_photos_after_a_fit_count_within_their_stage(trace: Trace, stages: list[RecordedStage]):
    last = [stage for stage in stages if stage.kind is StageKind.PHOTOS][-1]
    assert trace.steps[last.begin].position.sweep > sum(sweeps for _, sweeps, _ in AGAIN)
    assert progress_lines(trace)[last.begin].endswith("· sweep 1, iteration 1")


def test_energies_have_lines_in_stages_of_photos_only(by_photos: Session, trace: Trace, stages: list[RecordedStage]):
    history, alone = history_of(trace), history_of(by_photos.trace)
    lines, expected = history.lines(len(trace)), alone.lines(len(by_photos.trace))
    of_photos = [range(stage.begin, stage.end + 1) for stage in stages if stage.kind is StageKind.PHOTOS]
    assert all(any(set(line.moments) <= set(moments) for moments in of_photos) for line in lines)
    for line, same in zip(lines, expected, strict=True):
        np.testing.assert_allclose(line.values, same.values, rtol=1e-12)
    assert history.lines(stages[0].end) == []


def test_the_objective_of_a_fit_is_drawn_relative_to_the_beginning_of_its_stage(
    trace: Trace, stages: list[RecordedStage]
):
    lines = fit_lines(trace.steps, stages)
    fits = [stage for stage in stages if stage.kind.is_fit]
    assert len(lines) == len(fits)
    for line, stage in zip(lines, fits, strict=True):
        assert line.moments.tolist() == list(range(stage.begin, stage.end + 1))
        expected = 100 * 0.97 ** np.arange(stage.end - stage.begin + 1)
        np.testing.assert_allclose(line.values, expected, rtol=1e-9)


def test_the_band_covers_the_record_and_each_stage_leads_to_its_beginning(trace: Trace, stages: list[RecordedStage]):
    moment = stages[2].begin + 1
    markup = stage_band(stages, OPTIONS, len(trace), moment, lambda begin: f"go({begin})")
    found = re.findall(r"class='(stage[^']*)'.*?left:([\d.]+)%;width:([\d.]+)%.*?go\((\d+)\)", markup)
    assert [int(begin) for *_, begin in found] == [stage.begin for stage in stages]
    ends = [float(left) + float(width) for _, left, width, _ in found]
    np.testing.assert_allclose(ends, [100 * stage.end / len(trace) for stage in stages], atol=2e-3)
    assert [k for k, (css_class, *_) in enumerate(found) if css_class.endswith("now")] == [2]


@pytest.mark.parametrize("blindness", BLINDNESS)
def test_kinds_of_stages_differ_in_colour_or_pattern_with_any_colour_vision(blindness: str):
    colors = in_cielab(np.array(STAGE_COLORS, dtype=float), blindness)
    patterns = [re.findall(r"radial|-?\d+deg", stage_ground(kind)) for kind in StageKind]
    for a, b in itertools.combinations(StageKind, 2):
        apart = np.linalg.norm(colors[a] - colors[b])
        assert apart > 15 or patterns[a] != patterns[b], (a, b, apart)


def test_the_strip_shows_the_fall_of_a_fit_s_objective(trace: Trace):
    history = StepHistory()
    history.update(SimpleNamespace(run_id=1, trace=trace, length=len(trace)))  # pyright: ignore[reportArgumentType]
    judge = next(k for k, step in enumerate(trace.steps) if step.stage is StageKind.JUDGE)
    energy = history.picture("energy")[0].astype(int)
    assert energy[0][1] > energy[judge][1] + 50, "green where the objective fell by 3 %"


def test_report_and_exported_page_list_the_stages(
    scene: Scene, by_photos: Session, trace: Trace, stages: list[RecordedStage]
):
    session = Session(scene, trace=trace)
    report = run_report(session, "accurate", {}, {})
    assert [(s["kind"], s["level"], s["steps"]) for s in report["stages"]] == [
        (stage.kind.name.lower(), stage.level, stage.end - stage.begin) for stage in stages
    ]
    first = report["stages"][0]
    assert first["objective_left"] == pytest.approx(0.97**40)
    assert "objective_left" not in report["stages"][1]
    found, expected = (
        [(s.level, s.before, s.after, s.steps) for s in sweep_energies(run)] for run in (trace, by_photos.trace)
    )
    assert found == expected, "energies of sweeps are those of the photos"

    data = run_data(RunFacts(session))
    assert [(s["first"], s["end"]) for s in data["stages"]] == [(stage.begin, stage.end) for stage in stages]
    assert (data["steps"][0]["measure"], data["steps"][0]["before"]) == ("objective", trace.steps[0].objective_before)
    judge = data["steps"][stages[1].begin]
    assert (judge["before"], judge["after"]) == (None, None)
    assert KINDS[judge["kind"]].text == StageKind.JUDGE.text
    assert KINDS[data["steps"][0]["kind"]].text == StageKind.POINTS.text
    photos = [stage for stage in stages if stage.kind is StageKind.PHOTOS][-1]
    assert KINDS[data["steps"][photos.begin]["kind"]].title == "Gauss-Newton step"
    assert KINDS[data["steps"][-1]["kind"]].text == StageKind.JUDGE.text


def test_the_exported_page_has_the_pulls_where_stages_and_sweeps_begin(scene: Scene, by_photos: Session):
    session = Session(scene, trace=by_photos.trace)
    facts = RunFacts(session)
    data = pulls_of_run(facts, lambda fraction: None)
    sweeps = {step.sweep_moment for step in by_photos.trace.steps}
    assert set(data["moments"]) == sweeps | {stage.begin for stage in recorded_stages(by_photos.trace)}
    shape = (len(data["moments"]), len(data["terms"]), len(scene.mesh.vertices))
    px, shares = (unpacked(data[name]).reshape(shape) for name in ("px", "shares"))
    for k, moment in enumerate(data["moments"]):
        found = moment_pulls(session, moment)
        for t, term in enumerate(data["terms"]):
            np.testing.assert_allclose(px[k, t] * data["pxUnit"], found.px_of(term["name"]), atol=data["pxUnit"])
            row = found.index_of(term["name"])
            expected = np.full(shape[2], np.nan) if row is None else found.shares[row]
            known = np.isfinite(expected)
            assert (shares[k, t] > 0).tolist() == known.tolist()
            share = (shares[k, t].astype(float) - 1) * data["shareUnit"]
            np.testing.assert_allclose(share[known], expected[known], atol=data["shareUnit"])


def unpacked(packed: dict[str, str]) -> np.ndarray:
    """An array of unsigned numbers as the page unpacks it."""
    planes = np.frombuffer(zlib.decompress(base64.b64decode(packed["deflated"])), dtype=np.uint8)
    width = int(packed["kind"][1])
    return np.ascontiguousarray(planes.reshape(width, -1).T).view(f"<u{width}").ravel()


def test_a_run_with_many_stages_is_exported_with_few_moments_of_pulls(
    scene: Scene, trace: Trace, stages: list[RecordedStage]
):
    moments = pull_moments(RunFacts(Session(scene, trace=trace)))
    assert moments == [stage.begin for stage in stages], "46 sweeps more would be too many"
    assert len(moments) <= MOST_MOMENTS
