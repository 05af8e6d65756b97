"""Moments by name, bookmarks, runs and what is compared, without a browser."""

import json
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from app.cli import serve
from app.cli.loading import OpeningProgress
from app.cli.main import run
from app.debugger.bookmarks import Bookmarks, read_bookmarks
from app.debugger.commands import Branch, DeleteRun, Extent, Forward, JumpTo, Run, SwitchTo
from app.debugger.compare import Reference, RunEnergies, distances, look_up
from app.debugger.controller import Controller
from app.debugger.history import EnergyHistory
from app.debugger.moment_id import find_moment, moment_id, parse_moment_id
from app.debugger.runs import options_differing, run_title
from demo_scenes import Photography, load_demo
from fairing.errors import InputError
from fairing.options import PRESETS
from fairing.run.session import Session
from fairing.scene import Scene
from fairing.trace import SchedulePosition, StepReason, StepRecord, Trace, stage_of_reasons
from tests.commands import do
from tests.small_scene import write_corner
from tests.two_levels import two_levels

OPTIONS = two_levels("sequential", sweeps=2, iterations=3)


@pytest.fixture(scope="module")
def scene() -> Scene:
    return load_demo("cube", Photography())


@pytest.fixture(scope="module")
def finished(scene: Scene) -> Session:
    session = Session(scene, OPTIONS)
    session.run()
    return session


def test_every_moment_s_name_leads_back_to_it(finished: Session):
    trace = finished.trace
    positions = [trace.steps[0].position, *(record.next_position for record in trace.steps)]
    names = [moment_id(position, moment, 2) for moment, position in enumerate(positions)]
    assert (names[0], names[-1]) == ("start", "end")
    assert names[1] == "1:1:1:2", "counted from 1, as on the page"
    assert len(set(names)) == len(names)
    assert [find_moment(trace, parse_moment_id(name, 2)) for name in names] == list(range(len(names)))


def test_a_moment_that_the_run_passed_by_is_the_next_one(finished: Session):
    beyond = SchedulePosition(0, 0, 99, 0)
    found = find_moment(finished.trace, beyond)
    assert finished.trace.steps[found - 1].next_position == SchedulePosition(0, 1, 0, 0)


@pytest.mark.parametrize("text", ["", "1:1:1", "0:1:1:1", "3:1:1:1", "1:1:1:x", "1:1:1:1:1", "-1:1:1:1", "9" * 500])
def test_what_names_no_moment_is_said(text: str):
    with pytest.raises(InputError, match=r"--at .*expected"):
        parse_moment_id(text, 2)


def test_bookmarks_are_kept_in_order_and_one_a_moment():
    bookmarks = Bookmarks().added(1, 9, "end", "").added(1, 3, "1:1:2:1", " it  folds ").added(1, 9, "end", "done")
    assert [(item.moment, item.note) for item in bookmarks.items] == [(3, "it folds"), (9, "done")]
    assert bookmarks.removed(bookmarks.items[0].number).items[0].at == "end"
    with pytest.raises(InputError, match="200 characters"):
        bookmarks.added(1, 4, "start", "x" * 201)


def test_bookmarks_are_saved_beside_the_run_and_come_back_with_it(scene: Scene, tmp_path):
    path = tmp_path / "run.trace"
    controller = Controller(Session(scene, OPTIONS), save_to=path)
    length = do(controller, Forward(Extent.SWEEP)).length
    controller.edit_bookmarks(lambda b: b.added(1, 2, "1:1:1:3", "déjà <b>vu</b>"))
    controller.edit_bookmarks(lambda b: b.added(1, length, "end", ""))
    do(controller, JumpTo(2), Branch(replace(OPTIONS, lock_boundary=True)))
    controller.edit_bookmarks(lambda b: b.added(2, 1, "1:1:1:2", "of the branch"))
    controller.close()
    again = Controller(Session(scene, trace=Trace.load(path)), recorded_in=path)
    try:
        found = [(item.moment, item.at, item.note) for item in again.state.bookmarks]
        assert found == [(2, "1:1:1:3", "déjà <b>vu</b>"), (length, "end", "")]
    finally:
        again.close()
    rows = json.loads((tmp_path / "run-2.bookmarks.json").read_text())["bookmarks"]
    assert [row["note"] for row in rows] == ["of the branch"]


def test_a_damaged_file_of_bookmarks_is_said(tmp_path):
    path = tmp_path / "run.bookmarks.json"
    damaged = {
        "": "line 1: expected JSON",
        "[]": r"expected an object, found \[\]",
        '{"bookmarks": [{"at": 1}]}': r"bookmarks\[0\]: expected moment",
        '{"bookmarks": 3}': "bookmarks: expected a list, found 3",
    }
    for content, said in damaged.items():
        path.write_text(content)
        with pytest.raises(InputError, match=said):
            read_bookmarks(path, 10)
    assert read_bookmarks(tmp_path / "none.json", 10).items == ()


def test_a_reference_is_the_mesh_of_its_run_and_moment(scene: Scene):
    controller = Controller(Session(scene, OPTIONS))
    try:
        first = do(controller, Forward(Extent.SWEEP))
        now = do(controller, JumpTo(2), Branch(replace(OPTIONS, lock_boundary=True)), Run())
        found = look_up(Reference(first.run_id, 1), now)
        assert found is not None
        np.testing.assert_array_equal(found.vertices, first.trace.vertices_at(1))
        np.testing.assert_array_equal(
            distances(found, now.vertices), np.linalg.norm(now.vertices - first.trace.vertices_at(1), axis=1)
        )
        assert found.name == "Run 1 at 1:1:1:2"
        standing = look_up(Reference(first.run_id), now)
        assert standing is not None
        assert standing.moment == first.length  # the table of runs describes its last recorded step
        assert look_up(Reference(99), now) is None
        gone = do(controller, SwitchTo(now.run_id), DeleteRun(first.run_id))
        assert look_up(Reference(first.run_id, 1), gone) is None
    finally:
        controller.close()


def test_the_energies_of_a_run_are_those_it_had_when_it_was_at_hand(scene: Scene):
    controller = Controller(Session(scene, OPTIONS))
    try:
        at_hand = EnergyHistory(len(scene.mesh.faces))
        at_hand.update(do(controller, Forward(Extent.SWEEP)))
        state = do(controller, Branch(replace(OPTIONS, lock_boundary=True)), Run())
        energies = RunEnergies(len(scene.mesh.faces))
        for _ in range(2):
            np.testing.assert_array_equal(energies.of(state.runs[0]).after, at_hand.after)
        assert len(energies.of(state.runs[1]).after) == state.length
    finally:
        controller.close()


def test_an_energy_counts_as_measured_once_a_step_has_faces(scene: Scene):
    controller = Controller(Session(scene, OPTIONS.with_levels(smoothing=0.1)))
    try:
        energies = EnergyHistory(len(scene.mesh.faces))
        assert not energies.is_measured
        state = do(controller, Forward(Extent.SWEEP))
        for moment in range(1, state.length + 1):
            energies = EnergyHistory(len(scene.mesh.faces))
            energies.update(replace(state, length=moment))
            assert energies.is_measured == any(len(step.faces) for step in state.trace.steps[:moment])
        assert energies.is_measured
    finally:
        controller.close()


class Recording(NamedTuple):
    """A record of steps alone."""

    trace: Trace
    length: int
    run_id: int = 1


def trace_of(steps: list[StepRecord]) -> Trace:
    trace = Trace({}, np.zeros((3, 3)), np.array([[0, 1, 2]]))
    trace.steps = steps
    return trace


def test_energies_of_fits_do_not_mix_with_those_of_sweeps(finished: Session):
    steps = [step for step in finished.trace.steps if step.sweep_moment == 0]

    def fit(moment: int, reason: StepReason) -> StepRecord:
        reasons = np.full_like(steps[0].reasons, reason)
        record = replace(steps[0], reasons=reasons, sweep_moment=moment, stage=stage_of_reasons(reasons))
        return replace(record, face_energy_before=1e9 + record.faces, face_energy_after=1e8 + record.faces)

    end = 1 + len(steps)
    swept = [replace(step, sweep_moment=1) for step in steps]
    recorded = [fit(0, StepReason.FITTED_TO_POINTS), *swept, fit(end, StepReason.FITTED_AGAIN)]
    energies, alone = (EnergyHistory(len(finished.scene.mesh.faces)) for _ in range(2))
    for length in (3, end + 1):  # read in two parts
        energies.update(Recording(trace_of(recorded), length))
    alone.update(Recording(trace_of(steps), len(steps)))

    (line,) = energies.lines(end + 1)
    np.testing.assert_array_equal(line.moments, np.arange(1, end + 1))
    np.testing.assert_allclose(line.values, [alone.before[0], *alone.after], rtol=1e-12)
    for moment in (0, end):
        assert energies.before[moment] == recorded[moment].face_energy_before.sum()
        assert energies.after[moment] == recorded[moment].face_energy_after.sum()
    (begun,) = energies.lines(1)
    np.testing.assert_array_equal(begun.values, [energies.before[0], energies.after[0]])


def test_options_are_told_by_their_preset_and_what_differs():
    assert run_title(PRESETS["paper"]) == "paper"
    changed = replace(PRESETS["accurate"], lock_boundary=True)
    assert run_title(changed) == "accurate, lock boundary False → True"
    assert options_differing(PRESETS["accurate"], changed) == "lock boundary False → True"


def opened(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> Session:
    found = []
    monkeypatch.setattr(serve, "serve", lambda open_session, **_: found.append(open_session(OpeningProgress())))
    assert run(arguments) == 0
    return found[0]


def test_view_runs_up_to_the_moment_it_is_told(monkeypatch: pytest.MonkeyPatch, tmp_path):
    write_corner(tmp_path / "corner")
    at_start = opened(monkeypatch, "view", str(tmp_path / "corner"))
    assert at_start.moment == 0
    at_start.step_sweep()
    name = moment_id(at_start.position, at_start.moment, at_start.options.n_levels)
    session = opened(monkeypatch, "view", str(tmp_path / "corner"), "--at", name)
    assert session.moment == len(session.trace) == at_start.moment
    assert session.position == at_start.position


def test_replay_opens_at_the_moment_it_is_told(
    monkeypatch: pytest.MonkeyPatch, capsys, scene: Scene, finished, tmp_path
):
    path = tmp_path / "run.trace"
    finished.trace.header["source"] = {"scene": "cube", "mesh": None}
    finished.trace.attach(path)
    finished.trace.detach()
    monkeypatch.setattr("app.files.scene_source.load_named", lambda *_, **__: scene)
    assert opened(monkeypatch, "replay", str(path)).moment == 0
    assert opened(monkeypatch, "replay", str(path), "--at", "end").moment == len(finished.trace)
    assert opened(monkeypatch, "replay", str(path), "--at", "1:1:2:1").position == SchedulePosition(0, 0, 1, 0)
    assert run(["replay", str(path), "--at", "nowhere"]) == 1
    assert "level:sweep:vertex:iteration" in capsys.readouterr().err
