"""Runs whose smoothing and fits are steps: stopped anywhere, branched, edited, stepped back, and those of former versions."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from demo_scenes.building.scene import scene_of_plan
from fairing.options import FairingOptions, options_to_dict
from fairing.run.recorded_stages import recorded_stages
from fairing.run.session import Session
from fairing.run_plan import RunPlan
from fairing.scene import Scene
from fairing.stage_kind import StageKind
from fairing.trace import StepReason, Trace
from tests.record_files import block, run_header, step, text
from tests.small_building import small_building
from tests.small_scene import FACES, START, VERTICES, corner_scene, observed, on_the_faces, small_options

PLAN = RunPlan(
    0,
    is_smoothed=True,
    is_fitted_to_points=True,
    represents_surface=True,
    has_photos_of_points=True,
    records_fit=True,
)
N = len(VERTICES)


def options(order: str = "joint", **changes) -> FairingOptions:
    schedule = {"order": order, "max_sweeps": [2], "max_iterations": [2], "blur": [2.0, 0.8]}
    step = {"points": [0.3], "smoothing": [0.1]}
    return small_options(schedule=schedule, step=step, **changes)


def scene() -> Scene:
    return observed(corner_scene(), on_the_faces(600))


def planned(chosen: FairingOptions | None = None) -> Session:
    """A run that has every kind of stage."""
    session = Session(scene(), chosen or options())
    session.trace.record_plan(PLAN)
    return session


@pytest.fixture(scope="module")
def whole() -> Session:
    session = planned()
    session.run()
    return session


def written(trace: Trace, folder: Path) -> bytes:
    """The file of a trace, without its header, which has the number of threads."""
    copy = trace.cut(len(trace))
    copy.header = {}
    copy.attach(folder / "bytes.trace")
    copy.detach()
    return (folder / "bytes.trace").read_bytes()


def reloaded(session: Session, moment: int, folder: Path) -> Session:
    """A new session on what the file of a run stopped at a moment holds."""
    part = session.trace.cut(moment)
    part.attach(folder / "part.trace")
    part.detach()
    return Session(session.scene, trace=Trace.load(folder / "part.trace"))


def moment_in(session: Session, kind: StageKind, number: int = 0, after: int = 1) -> int:
    """A moment some steps after a stage of a kind began, which has more steps."""
    found = [stage for stage in recorded_stages(session.trace) if stage.kind is kind]
    assert found[number].end - found[number].begin > after
    return found[number].begin + after


def test_the_run_has_smoothing_fit_photos_and_judges(whole: Session):
    kinds = [stage.kind for stage in recorded_stages(whole.trace)]
    assert kinds[:3] == [StageKind.SMOOTHNESS, StageKind.JUDGE, StageKind.POINTS]
    assert kinds.count(StageKind.POINTS) == 1
    assert StageKind.PHOTOS in kinds
    assert kinds[-1] is StageKind.JUDGE
    assert whole.finished


def test_a_run_stopped_after_any_step_makes_the_same_next_one(whole: Session, tmp_path: Path):
    """Reloaded from its file, in a session that knows nothing of the steps before: by induction every resumed run is the same."""
    for moment in range(len(whole.trace)):
        resumed = reloaded(whole, moment, tmp_path)
        resumed.step()
        assert written(resumed.trace, tmp_path) == written(whole.trace.cut(moment + 1), tmp_path), moment


def test_a_run_resumed_to_its_end_writes_the_same_bytes(whole: Session, tmp_path: Path):
    for moment in (1, moment_in(whole, StageKind.POINTS), moment_in(whole, StageKind.CLOSEST_POINTS)):
        resumed = reloaded(whole, moment, tmp_path)
        resumed.run()
        assert written(resumed.trace, tmp_path) == written(whole.trace, tmp_path), moment


@pytest.mark.slow
def test_a_building_stopped_in_every_stage_goes_on_alike_to_the_byte(tmp_path: Path):
    plan = replace(small_building(), has_points=True, start_px=4.0)
    session = Session(replace(scene_of_plan("building with points", plan), points_choice="given"))
    session.run()
    stages = recorded_stages(session.trace)
    assert session.plan is not None
    assert session.plan.records_fit
    assert session.plan.is_fitted_to_points
    middles = {(stage.begin + stage.end) // 2 for stage in stages if stage.kind is not StageKind.PHOTOS}
    for moment in sorted(middles | {stage.begin for stage in stages} | {len(session.trace) - 1}):
        resumed = reloaded(session, moment, tmp_path)
        resumed.step()
        assert written(resumed.trace, tmp_path) == written(session.trace.cut(moment + 1), tmp_path), moment
    last_fit = max(stage.begin for stage in stages if stage.kind.is_fit)
    resumed = reloaded(session, last_fit + 1, tmp_path)
    resumed.run()
    assert written(resumed.trace, tmp_path) == written(session.trace, tmp_path)
    photos = next(stage.begin for stage in stages if stage.kind is StageKind.PHOTOS)
    found, expected = (run.sweep_state(photos).near_points for run in (resumed, session))
    assert found is not None
    assert expected is not None
    assert np.array_equal(found.positions, expected.positions), "of the searches of the fit before the photos"


@pytest.mark.parametrize("threads", [1, 3])
def test_the_number_of_threads_changes_no_byte(whole: Session, threads: int, tmp_path: Path):
    session = planned(options(threads=threads))
    session.run()
    assert written(session.trace, tmp_path) == written(whole.trace, tmp_path)


@pytest.mark.parametrize("kind", [StageKind.SMOOTHNESS, StageKind.POINTS, StageKind.CLOSEST_POINTS])
def test_a_branch_within_a_fit_goes_on_as_the_run_did(whole: Session, kind: StageKind, tmp_path: Path):
    whole.go_to(moment_in(whole, kind))
    branch = whole.branch()
    assert branch.next_stage is kind
    branch.run()
    assert written(branch.trace, tmp_path) == written(whole.trace, tmp_path)


@pytest.mark.parametrize("kind", [StageKind.SMOOTHNESS, StageKind.POINTS, StageKind.CLOSEST_POINTS])
@pytest.mark.parametrize("order", ["joint", "sequential"])
def test_a_branch_within_a_fit_goes_on_under_other_options(whole: Session, kind: StageKind, order: str):
    whole.go_to(moment_in(whole, kind))
    length, changed = len(whole.trace), options(order, locked_vertices=(0,))
    branch = whole.branch(changed.with_levels(max_sweeps=1))
    branch.trace.record_plan(PLAN)
    assert branch.next_stage is kind
    assert branch.position == whole.position._replace(iteration=0)
    branch.run()
    assert branch.finished
    later = branch.trace.steps[whole.moment :]
    # A judge puts the mesh back as it was, with the vertices that have been locked since.
    assert all(0 not in record.vertices for record in later if record.stage is not StageKind.JUDGE)
    assert len(whole.trace) == length


@pytest.mark.parametrize("points", [[0.0], [0.3]])
def test_a_branch_within_a_fit_is_planned_anew_and_ends(whole: Session, points: list[float]):
    """Also under a plan without any fit: photos go on at its level."""
    for moment in (moment_in(whole, StageKind.POINTS), moment_in(whole, StageKind.CLOSEST_POINTS)):
        whole.go_to(moment)
        branch = whole.branch(small_options(schedule={"blur": [2.0, 0.8]}, step={"points": points, "smoothing": [0.0]}))
        assert branch.plan is None
        branch.run()
        assert branch.finished
        assert branch.trace.steps[moment - 1 :][-1].stage is StageKind.JUDGE


@pytest.mark.parametrize("kind", [StageKind.POINTS, StageKind.CLOSEST_POINTS])
def test_a_manual_edit_within_a_fit_leaves_its_rest_out(whole: Session, kind: StageKind, tmp_path: Path):
    moment = moment_in(whole, kind)
    session = reloaded(whole, moment, tmp_path)
    place = session.vertices[[0]] + 0.01
    record = session.place(np.array([0]), place)
    assert record.stage is StageKind.MANUAL
    assert session.next_stage is StageKind.PHOTOS
    assert session.position == (record.position.level, 0, 0, 0)
    assert np.array_equal(session.vertices[[0]], place)
    straight = reloaded(session, len(session.trace), tmp_path)
    session.run()
    later = [stage.kind for stage in recorded_stages(session.trace) if stage.begin > moment]
    assert set(later) == {StageKind.PHOTOS, StageKind.JUDGE}
    assert later[-1] is StageKind.JUDGE
    straight.run()
    assert written(straight.trace, tmp_path) == written(session.trace, tmp_path)


def test_stepping_back_shows_every_moment_as_it_was(whole: Session):
    places = [whole.trace.start]
    for record in whole.trace.steps:
        places.append(places[-1].copy())
        places[-1][record.vertices] = record.after
    for moment in reversed(range(len(places))):
        whole.go_to(moment)
        assert np.array_equal(whole.vertices, places[moment])
        if moment < len(whole.trace):
            assert whole.next_stage is whole.trace.steps[moment].stage
    whole.go_to(len(whole.trace))
    assert whole.next_stage is None


def test_step_stage_ends_where_the_stage_does(whole: Session):
    live = planned()
    whole.go_to(0)
    ends = [stage.end for stage in recorded_stages(whole.trace)]
    for session in (live, whole):
        found = []
        while not session.finished:
            last = session.step_stage()
            assert last is session.trace.steps[session.moment - 1]
            found.append(session.moment)
        assert found == ends
        assert session.step_stage() is None


def test_progress_never_falls(whole: Session):
    fractions = []
    for moment in range(len(whole.trace) + 1):
        whole.go_to(moment)
        fractions.append(whole.progress)
    assert fractions == sorted(fractions)
    assert (fractions[0], fractions[-1]) == (0.0, 1.0)
    assert len(set(fractions)) > 4


# ------------------------------------------------------------------ traces of former versions

START_OF_RUN = VERTICES + np.where(np.arange(N)[:, None] == 0, START, 0.0)


def former_trace(path: Path, *, again: StepReason | None) -> Path:
    """A trace whose smoothing and fits are a step each, without kinds of stages and with a plan that says nothing of them.

    Args:
        again: outcome of a second fit after the last photos; None: the run was stopped after one iteration of photos.
    """
    former = {
        "first_level": 0, "is_smoothed": True, "is_fitted_to_points": True, "start_sigma": 0.0, "edge_reach": 2.0,
        "represents_surface": True, "has_second_fit": True,
    }  # fmt: skip
    header = run_header() | {"options": options_to_dict(options())}
    places = [START_OF_RUN, START_OF_RUN + 0.001, VERTICES + 0.004]

    def of_all(at: tuple, following: tuple, moment: int, reason: StepReason, before: np.ndarray, after: np.ndarray):
        n = len(before)
        zeros = np.zeros(n)
        return step(
            position=np.array(at), next_position=np.array(following), sweep_moment=np.array(moment),
            vertices=np.arange(n), before=before, proposed=after - before, after=after, step_px=zeros, damping=zeros,
            eigenvalues=np.zeros((n, 3)), reasons=np.full(n, reason, np.int8), damping_next=zeros,
            rejections=np.zeros(n, int),
        )  # fmt: skip

    zero = (0, 0, 0, 0)
    steps = [
        of_all(zero, zero, 0, StepReason.SMOOTHED, places[0], places[1]),
        of_all(zero, zero, 1, StepReason.FITTED_TO_POINTS, places[1], places[2]),
    ]
    if again is None:
        steps.append(of_all(zero, (0, 0, 0, 1), 2, StepReason.ACCEPTED, places[2], places[2] - 0.001))
    else:
        rejected = again is StepReason.REJECTED_FIT
        moved, following = places[2] - 0.001, (2, 0, 0, 0) if rejected else (1, 3, 0, 0)
        steps.append(of_all((1, 1, 0, 1), (1, 2, 0, 0), 2, StepReason.ACCEPTED, places[2], moved))
        steps.append(of_all((1, 2, 0, 0), following, 3, again, moved, moved if rejected else VERTICES + 0.003))
    first = {"text_header": text(header), "start": START_OF_RUN, "faces": FACES}
    blocks = [block(**first), block(text_plan=text(former)), *(block(**values) for values in steps)]
    path.write_bytes(b"EIGENFAIRING TRACE 1\n" + b"".join(blocks))
    return path


def former_session(path: Path) -> Session:
    trace = Trace.load(path)
    given = scene()
    trace.header |= {"sparse_points": Session(given, options()).trace.header["sparse_points"]}
    return Session(given, trace=trace)


OUTCOMES = [None, StepReason.FITTED_AGAIN, StepReason.REJECTED_FIT]


@pytest.mark.parametrize("again", OUTCOMES)
def test_a_former_trace_shows_its_stages(again: StepReason | None, tmp_path: Path):
    trace = former_session(former_trace(tmp_path / "old.trace", again=again)).trace
    kinds = [stage.kind for stage in recorded_stages(trace)]
    assert kinds == [StageKind.SMOOTHNESS, StageKind.FIT, StageKind.PHOTOS] + ([StageKind.FIT] if again else [])
    assert trace.plan is not None
    assert not trace.plan.records_fit


@pytest.mark.parametrize("again", OUTCOMES)
def test_a_former_trace_goes_on_with_photos_from_where_its_fit_led(again: StepReason | None, tmp_path: Path):
    session = former_session(former_trace(tmp_path / "old.trace", again=again))
    recorded = len(session.trace)
    assert session.finished == (again is StepReason.REJECTED_FIT)
    for moment in range(recorded + 1):
        session.sweep_state(moment)
        session.pulls(moment)
    session.run()
    kinds = [record.stage for record in session.trace.steps[recorded:]]
    assert set(kinds) == (set() if again is StepReason.REJECTED_FIT else {StageKind.PHOTOS, StageKind.JUDGE})
    assert session.finished
    again_resumed = reloaded(session, recorded, tmp_path)
    again_resumed.run()
    assert written(again_resumed.trace, tmp_path) == written(session.trace, tmp_path)


def test_photos_after_a_former_second_fit_hold_to_where_it_led(tmp_path: Path):
    session = former_session(former_trace(tmp_path / "old.trace", again=StepReason.FITTED_AGAIN))
    assert np.array_equal(session._sweeps.history.origin_at(session.moment), VERTICES + 0.003)
