"""Work in progress: what long computations report of themselves."""

import numpy as np
import pytest

from app.debugger.work_report import report_of
from app.html import duration
from fairing.errors import Cancelled
from fairing.options import PRESETS
from fairing.run.session import Session
from fairing.work import Work, WorkLog, fraction_done
from tests.rough_scene import rough_options, rough_scene
from tests.small_scene import corner_scene


def test_nested_works_divide_the_fraction_of_the_outer_one():
    log = WorkLog()
    assert log.current == ()
    with log.doing("searching", 4) as outer:
        outer.advance()
        with log.doing("reading", 10) as inner:
            for _ in range(5):
                inner.advance()
            assert [work.text for work in log.current] == ["searching", "reading"]
            assert fraction_done(log.current) == pytest.approx(1 / 4 + 5 / 10 / 4)
        assert fraction_done(log.current) == 1 / 4
    assert log.current == ()


def test_a_work_ends_with_an_exception():
    log = WorkLog()
    with pytest.raises(Cancelled), log.doing("searching"):
        raise Cancelled
    assert log.current == ()


def test_a_report_names_the_parts_and_the_time_that_remains(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("app.debugger.work_report.time.monotonic", lambda: 112.0)
    outer = Work("searching 81 vertices", 15, "direction", 3, began=100.0)
    inner = Work("reading the photos", 12, began=111.0)
    report = report_of([outer, inner])
    assert report is not None
    assert report.fraction == pytest.approx(0.2)
    assert report.seconds_left == 48.0
    assert report.line == "Searching 81 vertices: direction 4 of 15; 48 s left"
    photos = report_of([Work("reading the photos", 12, done=6, began=100.0)])
    assert photos is not None
    assert photos.line == "Reading the photos, 6 of 12; 12 s left"
    assert report_of([]) is None
    unknown = report_of([Work("fitting the points", began=107.6)])
    assert unknown is not None
    assert (unknown.line, unknown.time) == ("Fitting the points; 4 s", "4 s")
    assert report_of([Work("measuring 3 faces", began=111.9)]) is None


def test_durations_are_rounded_to_two_units():
    assert [duration(s) for s in (0.4, 12.2, 200, 3900)] == ["0 s", "12 s", "3 min 20 s", "1 h 5 min"]


def test_a_session_reports_its_plan_and_its_sweeps_photo_by_photo():
    session = Session(rough_scene(), rough_options())
    seen: dict[str, list[tuple[int, int]]] = {}

    def look() -> bool:
        for work in session.work.current:
            seen.setdefault(work.text, []).append((work.done, work.count))
        return False

    session.cancel_requested = look
    session.step_sweep()
    assert session.work.current == ()
    assert session.plan is not None
    assert session.plan.is_smoothed
    assert "trying a smoothed start" in seen
    done = np.array(seen["finding the photos that see each face"])
    assert (done[:, 1] == len(session.scene.views)).all()
    assert done[-1, 0] > done[0, 0]


def test_a_cancelled_step_leaves_no_work_behind():
    session = Session(corner_scene(), PRESETS["accurate"])
    calls = iter(range(1_000_000))
    session.cancel_requested = lambda: next(calls) > 30
    with pytest.raises(Cancelled):
        session.step()
    assert session.work.current == ()
