"""Reports of the sweep that a command executes: what is counted, and whose remaining time is estimated."""

from dataclasses import replace

import pytest

from app.debugger.commands import Command, Extent, Forward, Run
from app.debugger.sweep_progress import SweepProgress
from app.debugger.work_report import WorkReport
from fairing.options import FairingOptions
from fairing.run.session import Session
from tests.small_scene import corner_scene, small_options

SWEEP = Forward(Extent.SWEEP)
SEQUENTIAL = small_options(schedule={"order": "sequential", "max_iterations": [1], "first_level": "first"})


class Clock:
    """A time that passes when a test lets it pass."""

    now = 100.0


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr("app.debugger.sweep_progress.time.monotonic", lambda: clock.now)
    return clock


def session_of(options: FairingOptions) -> Session:
    return Session(corner_scene(), options)


def report_of(progress: SweepProgress, session: Session, command: Command) -> WorkReport:
    report = progress.report(session, command, 100.0)
    assert report is not None
    return report


def test_a_sweep_of_single_vertices_counts_them_and_estimates_its_time(clock: Clock):
    session, progress = session_of(SEQUENTIAL), SweepProgress()
    session.step()
    n_blocks = len(session.sweep_state().blocks)
    assert report_of(progress, session, SWEEP) == WorkReport(f"vertex 2 of {n_blocks}", 1 / n_blocks)
    session.step()
    clock.now += 5.0
    report = report_of(progress, session, SWEEP)
    assert report.line == f"Vertex 3 of {n_blocks}; {5 * (n_blocks - 2)} s left"
    assert report.fraction == pytest.approx(2 / n_blocks)


def test_a_run_counts_the_vertices_without_a_time_and_shorter_steps_count_nothing(clock: Clock):
    session, progress = session_of(SEQUENTIAL), SweepProgress()
    session.step()
    n_blocks = len(session.sweep_state().blocks)
    for command in (Run(), Forward(Extent.LEVEL)):
        report_of(progress, session, command)
        clock.now += 9.0
        assert report_of(progress, session, command) == WorkReport(f"vertex 2 of {n_blocks}")
    for extent in (Extent.BLOCK, Extent.ITERATION):
        assert progress.report(session, Forward(extent), 100.0) is None


def test_nothing_is_counted_where_the_record_is_repeated_or_all_vertices_move_at_once():
    session, progress = session_of(SEQUENTIAL), SweepProgress()
    session.step()
    session.step()
    session.go_to(1)
    assert progress.report(session, SWEEP, 100.0) is None
    joint = Session(session.scene, replace(SEQUENTIAL, schedule=replace(SEQUENTIAL.schedule, order="joint")))
    joint.step()
    assert progress.report(joint, SWEEP, 100.0) is None


def test_a_command_that_continues_a_sweep_measures_its_own_time(clock: Clock):
    session, progress = session_of(SEQUENTIAL), SweepProgress()
    session.step()
    report_of(progress, session, SWEEP)
    clock.now += 1000.0
    assert progress.report(session, SWEEP, 1100.0) is not None
    session.step()
    clock.now += 5.0
    report = progress.report(session, SWEEP, 1100.0)
    assert report is not None
    assert report.seconds_left == 5 * (len(session.sweep_state().blocks) - 2)
