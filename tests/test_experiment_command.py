"""Experiments on the command line, in their processes, on the page's experiment runner, and as files."""

import csv
import io
import json
import os
import signal
import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from app.cli import experiment as experiment_command
from app.cli.main import run
from app.experiments.chart import charts_of
from app.experiments.experiment_runner import ExperimentRunner, Status
from app.experiments.record import Record
from app.experiments.workers import measure_all
from fairing.errors import InputError
from fairing.experiments import EXPERIMENTS, CaptureRange, Row, Setting, WarpComparison, results
from fairing.options import LEVEL_GROUPS
from tests.small_scene import corner_scene, small_options
from tests.waiting import wait_for

pytestmark = pytest.mark.slow

ONE_LEVEL = small_options(schedule={"blur": [1.2], "max_sweeps": [3]}, cells={"size": [32]})
FLAGS = ["--starts", "4", "8", "--directions", "2", "--schedule.blur", "1.2", "--schedule.max-sweeps", "2"]
FLAGS += ["--cells.size", "32", "--step.smoothing", "0"]
EXPERIMENT = CaptureRange(starts=(4.0, 8.0), directions=3)


@pytest.fixture(scope="module")
def setting() -> Setting:
    return Setting.of(corner_scene(), ONE_LEVEL)


@pytest.fixture(scope="module")
def rows(setting: Setting) -> list[Row]:
    return list(results(EXPERIMENT, setting))


# ---------------------------------------------------------------------- processes


def never() -> bool:
    return False


def test_processes_measure_what_one_after_another_measures(setting: Setting, rows: list[Row]):
    found: list[Row] = []
    assert measure_all(EXPERIMENT, setting, EXPERIMENT.cases(setting), 2, found.append, never)
    assert sorted(found, key=str) == sorted(rows, key=str)


def test_a_wish_to_stop_ends_the_processes_at_once(setting: Setting):
    found: list[Row] = []
    many = CaptureRange(starts=tuple(np.linspace(1, 9, 200)), directions=6)
    assert not measure_all(many, setting, many.cases(setting), 1, found.append, lambda: len(found) >= 2)
    assert 2 <= len(found) < 20


class Failing(CaptureRange):
    """Measures nothing."""

    def measure(self, setting: Setting, case: Row) -> Row:
        raise ValueError("no such luck")


class Dying(CaptureRange):
    """Takes its process with it."""

    def measure(self, setting: Setting, case: Row) -> Row:
        raise SystemExit(3)


@pytest.mark.parametrize(("kind", "said"), [(Failing, "ValueError: no such luck"), (Dying, "ended unexpectedly")])
def test_what_goes_wrong_in_a_process_is_one_line(setting: Setting, kind: type[CaptureRange], said: str):
    with pytest.raises(InputError, match=said):
        measure_all(kind(), setting, EXPERIMENT.cases(setting), 1, lambda row: None, never)


# ---------------------------------------------------------------------- the page's experiment runner


def test_the_runner_works_in_the_background_and_keeps_the_outcome(setting: Setting, rows: list[Row]):
    told = threading.Event()
    runner = ExperimentRunner(setting.scene, "corner", told.set)
    assert runner.obstacle() == ""
    runner.start(EXPERIMENT, ONE_LEVEL)
    with pytest.raises(InputError, match="Capture range is running"):
        runner.start(WarpComparison(), ONE_LEVEL)
    wait_for(lambda: runner.working is None, 300)
    outcome = runner.outcome("capture-range")
    assert outcome is not None
    assert outcome.record is not None
    assert outcome.status is Status.DONE
    assert outcome.record.in_order(outcome.rows) == rows
    assert told.is_set()
    runner.close()


def test_a_cancelled_experiment_keeps_what_it_has(setting: Setting):
    runner = ExperimentRunner(setting.scene, "corner", lambda: None)
    runner.start(CaptureRange(starts=tuple(np.linspace(1, 9, 200))), ONE_LEVEL, vertex=0)
    wait_for(lambda: len(_rows(runner)) >= 1, 300)
    runner.cancel()
    wait_for(lambda: runner.working is None, 300)
    outcome = runner.outcome("capture-range")
    assert outcome is not None
    assert outcome.status is Status.CANCELLED
    assert len(_rows(runner)) >= 1
    runner.close()


def _rows(runner: ExperimentRunner) -> tuple[Row, ...]:
    outcome = runner.outcome("capture-range")
    return () if outcome is None else outcome.rows


def test_a_scene_without_truth_says_so_and_starts_nothing():
    runner = ExperimentRunner(replace(corner_scene(), truth=None), "corner", lambda: None)
    assert "true positions of its vertices" in runner.obstacle()
    with pytest.raises(InputError, match="true positions"):
        runner.start(EXPERIMENT, ONE_LEVEL)
    assert runner.working is None


# ---------------------------------------------------------------------- files


def test_the_table_has_a_line_a_case_in_order_whichever_came_first(setting: Setting, rows: list[Row]):
    record = Record(EXPERIMENT, setting, "corner", EXPERIMENT.cases(setting))
    table = list(csv.DictReader(io.StringIO(record.csv(rows[::-1]).decode())))
    assert [(float(line["start_percent"]), int(line["direction"])) for line in table] == [
        (row["start_percent"], row["direction"]) for row in rows
    ]
    assert [float(line["end_percent"]) for line in table] == [row["end_percent"] for row in rows]


@pytest.mark.parametrize("name", list(EXPERIMENTS))
def test_every_experiment_has_a_picture_from_its_first_row_on(setting: Setting, name: str):
    experiment = EXPERIMENTS[name]()
    cases = experiment.cases(setting)
    rows = [_invented(experiment, case, n) for n, case in enumerate(cases)]
    record = Record(experiment, setting, "corner", cases)
    for some in (rows[:1], rows):
        charts = charts_of(experiment, cases, some)
        assert charts
        for chart in charts:
            for series in chart.series:
                assert (np.diff(series.x) > 0).all(), "places ascend"
                assert chart.x_range[0] <= series.x.min() <= series.x.max() <= chart.x_range[1]
                assert chart.y_range[0] <= series.y.min() <= series.y.max() <= chart.y_range[1]
        picture = Image.open(io.BytesIO(record.png(some)))
        assert picture.width >= 900
        assert record.png(some) == record.png(some)


def _invented(experiment, case: Row, n: int) -> Row:
    """A row with all columns, without the work."""
    made = {name: 0.01 * (n + 1) for name in experiment.columns} | {"path": [20.0, 5.0, 0.01 * (n + 1)]}
    made["error"] = [0.01 * (n + 1), 0.0, 0.0]
    if "noise" in case:
        made["noise_in_all"] = float(np.hypot(case["noise"], 0.29))
    return made | case


# ---------------------------------------------------------------------- the command


def command(out: Path, *flags: str) -> int:
    return run(["experiment", "capture-range", "cube", "--out", str(out), *FLAGS, *flags])


def test_without_a_name_the_experiments_are_listed(capsys):
    assert run(["experiment"]) == 0
    said = capsys.readouterr().out
    for name, experiment in EXPERIMENTS.items():
        assert name in said
        assert experiment.question in said


def test_ctrl_c_keeps_what_is_done_and_resume_ends_where_an_unbroken_one_ends(tmp_path, capsys):
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    assert command(whole) == 0
    assert "converged" in capsys.readouterr().err
    line = [sys.executable, "-m", "app", "experiment", "capture-range", "--out", str(broken), *FLAGS]
    process = subprocess.Popen(line, stderr=subprocess.PIPE, text=True, start_new_session=True)
    assert process.stderr is not None
    assert "end_percent" in process.stderr.readline()
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: all processes hear it
    _, errors = process.communicate(timeout=300)
    assert process.returncode == 130, errors
    assert "Traceback" not in errors
    assert "continue with --resume" in errors
    record = json.loads((broken / "capture-range.json").read_text())
    assert 1 <= len(record["rows"]) < 4
    assert not record["finished"]
    assert (broken / "capture-range.png").exists()
    levels = record["options"].pop("levels")  # as records had them before: lists by group
    for name, group in LEVEL_GROUPS.items():
        record["options"][group][name] = [level[name] for level in levels]
    (broken / "capture-range.json").write_text(json.dumps(record))
    assert command(broken, "--resume") == 0
    for ending in ("csv", "png", "json"):
        names = [folder / f"capture-range.{ending}" for folder in (whole, broken)]
        assert names[0].read_bytes() == names[1].read_bytes(), ending
    record = json.loads((broken / "capture-range.json").read_text())
    assert record["finished"]
    assert {level["size"] for level in record["options"]["levels"]} == {32}
    assert record["versions"]["numpy"] == np.__version__


def test_a_resumed_experiment_must_be_the_same(tmp_path, capsys):
    (tmp_path / ".eigenfairing").write_text("")
    (tmp_path / "capture-range.json").write_text("{}")
    assert command(tmp_path, "--resume") == 1
    assert "expected the record of an experiment" in capsys.readouterr().err
    assert (tmp_path / "capture-range.json").read_text() == "{}"


def test_a_folder_with_other_content_is_left_alone(tmp_path, capsys):
    (tmp_path / "thesis.txt").write_text("mine")
    assert command(tmp_path) == 1
    assert "expected an empty or new folder" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]


def test_a_scene_without_truth_is_one_line_and_is_not_even_opened(tmp_path, capsys):
    (tmp_path / "capture").mkdir()
    assert run(["experiment", "noise", str(tmp_path / "capture"), "--out", str(tmp_path / "out")]) == 1
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert "expected a demo (cube, facade, archway, dome, building:SEED)" in lines[0]
    assert not (tmp_path / "out").exists()


def test_cameras_are_refined_on_request(tmp_path, monkeypatch, capsys):
    asked: list[str] = []

    def load(source, console):
        asked.append(source.cameras)
        raise InputError("enough")

    monkeypatch.setattr(experiment_command, "load_with_points", load)
    assert command(tmp_path / "one", "--cameras", "refine") == 1
    assert command(tmp_path / "two") == 1
    assert asked == ["refine", "automatic"]
    assert "enough" in capsys.readouterr().err


def test_a_record_of_other_cameras_is_not_continued(setting: Setting, tmp_path):
    record = Record(EXPERIMENT, setting, "corner", EXPERIMENT.cases(setting))
    record.save(tmp_path, [], picture=False)
    assert record.earlier_rows(tmp_path) == []
    path = tmp_path / f"{record.stem}.json"
    values = json.loads(path.read_text())
    del values["cameras"]  # as older versions wrote it
    path.write_text(json.dumps(values))
    assert record.earlier_rows(tmp_path) == []
    path.write_text(json.dumps(values | {"cameras": "corrected"}))
    with pytest.raises(InputError, match="different cameras"):
        record.earlier_rows(tmp_path)
