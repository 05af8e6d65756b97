"""The command line: results, exit codes, and one line for every mistake."""

import json
import os
import re
import resource
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from app.cli import fair as headless
from app.cli.arguments import with_current_flags
from app.cli.main import run
from app.files.scene_source import SceneSource
from fairing.cells.context import build_context
from fairing.io import load_scene, read_mesh
from fairing.run.session import Session
from fairing.run.stepper import Stepper
from fairing.solve.problem import Problem
from fairing.trace import Trace
from tests.small_scene import VERTICES, write_corner

QUICK = ["--schedule.blur", "2", "1", "--schedule.max-sweeps", "1", "--cells.size", "32"]
FIRST = ["--schedule.first-level", "first"]


@pytest.fixture
def scene(tmp_path) -> Path:
    write_corner(tmp_path / "corner")
    return tmp_path / "corner"


def fair(scene: Path, out: Path, *flags: str) -> int:
    return run(["fair", str(scene), "--out", str(out), *QUICK, *flags])


def one_line(capsys) -> str:
    """What was said on standard error, checked to be a single line."""
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1, lines
    return lines[0]


def test_fair_writes_a_mesh_in_the_input_s_order_a_report_and_a_trace(scene, tmp_path):
    out = tmp_path / "out"
    assert fair(scene, out, "--schedule.max-sweeps", "4", *FIRST) == 0
    vertices, faces = read_mesh(out / "mesh.ply")
    before, faces_before = read_mesh(scene / "mesh.obj")
    assert np.array_equal(faces, faces_before)
    assert vertices.shape == before.shape
    assert np.array_equal(vertices[0], vertices[7])
    assert np.linalg.norm(vertices[0] - VERTICES[0]) < 0.5 * np.linalg.norm(before[0] - VERTICES[0])
    trace = Trace.load(out / "run.trace")
    assert np.array_equal(trace.vertices_at(len(trace)), vertices[:7])
    assert np.array_equal(read_mesh(out / "mesh.obj")[0], vertices)  # the start mesh's format


def test_fair_with_everything_locked_says_that_nothing_could_move(scene, tmp_path, capsys):
    every = [str(vertex) for vertex in range(8)]
    assert fair(scene, tmp_path / "out", "--preset", "paper", "--locked-vertices", *every) == 1
    (end,) = (line for line in capsys.readouterr().err.splitlines() if "could move" in line)
    assert end.startswith("eigenfairing: ")
    assert "corner: no vertex could move: 7 of 7 vertices are locked; unlock some; " in end
    assert np.array_equal(read_mesh(tmp_path / "out" / "mesh.ply")[0], read_mesh(scene / "mesh.obj")[0])


def test_into_a_file_progress_is_plain_lines(scene, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("app.cli.run_progress.LINE_EVERY", 0.0)
    fair(scene, tmp_path / "out")
    lines = capsys.readouterr().err.splitlines()
    assert any(line.startswith("preparing: photo 2 of 8 (0 % done") for line in lines)
    shares = [int(found[1]) for line in lines if (found := re.search(r"^level .*\((\d+) % done", line))]
    assert shares == sorted(shares)
    assert shares[-1] == 100


def test_the_report_adds_up(scene, tmp_path):
    out = tmp_path / "out"
    fair(scene, out, "--locked-vertices", "2", "3", "--points", "none")
    report = json.loads((out / "report.json").read_text())
    trace = Trace.load(out / "run.trace")
    assert report["preset"] == "accurate"
    assert [level["blur"] for level in report["options"]["levels"]] == [2.0, 1.0]
    assert report["finished"]
    assert report["stop_reason"].startswith("finished")
    assert [(s["level"], s["sweep"]) for s in report["sweeps"]] == [(0, 0), (1, 0)]
    for sweep in report["sweeps"]:
        steps = [s for s in trace.steps if s.position[:2] == (sweep["level"], sweep["sweep"])]
        assert sweep["before"] == pytest.approx(steps[0].face_energy_before.sum())
        assert sweep["after"] == pytest.approx(steps[-1].face_energy_after.sum())
        assert sweep["after"] <= sweep["before"]
    by_input = {i: vertex for vertex in report["vertices"] for i in vertex["input_vertices"]}
    assert by_input[0] is by_input[7]
    assert by_input[0]["moved"] == pytest.approx(np.linalg.norm(trace.vertices_at(len(trace))[0] - trace.start[0]))
    assert by_input[0]["views"] == 8
    assert len(by_input[0]["eigenvalues"]) == 3
    assert by_input[2]["moved"] == 0
    assert by_input[2]["stop_reason"] == "not moved: locked"
    assert {v["vertex"] for v in report["skipped"]["vertices"]} == {2, 3}
    assert report["seconds"]["total"] == pytest.approx(
        sum(report["seconds"][k] for k in ("loading", "photos", "visibility", "steps", "metrics"))
    )
    assert report["samples_per_second"] > 0
    assert report["quality"] == {"flipped_faces": []}


def test_flags_overlay_the_chosen_preset(scene, tmp_path):
    out = tmp_path / "out"
    assert fair(scene, out, "--preset", "paper", "--eigenspace.dimensions", "2", "--schedule.max-iterations", "2") == 0
    options = json.loads((out / "report.json").read_text())["options"]
    assert options["cells"]["warp"] == "affine"
    assert options["step"]["solver"] == "alternating"
    assert {level["dimensions"] for level in options["levels"]} == {2}


def test_the_trace_says_where_its_scene_is(scene, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run(["fair", "corner", "--out", "out", *QUICK]) == 0
    monkeypatch.chdir("/")
    trace = Trace.load(tmp_path / "out" / "run.trace")
    source = SceneSource.of_run(trace.header, tmp_path)
    assert source.scene == str(scene)
    Session(source.load(), trace=trace)


def interrupt_after(steps: int, monkeypatch) -> None:
    shown = []
    show = headless.RunProgress.show

    def show_and_interrupt(self, record):
        show(self, record)
        shown.append(record)
        if len(shown) == steps:
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(headless.RunProgress, "show", show_and_interrupt)


@pytest.mark.slow
def test_ctrl_c_saves_everything_and_resume_ends_where_an_unbroken_run_ends(scene, tmp_path, monkeypatch):
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    assert fair(scene, whole) == 0
    with monkeypatch.context() as patched:
        interrupt_after(3, patched)
        assert fair(scene, broken) == 130
    assert len(Trace.load(broken / "run.trace")) == 3
    report = json.loads((broken / "report.json").read_text())
    assert not report["finished"]
    vertices, _ = read_mesh(broken / "mesh.ply")
    assert np.array_equal(vertices[:7], Trace.load(broken / "run.trace").vertices_at(3))

    assert fair(scene, broken, "--resume") == 0
    assert (broken / "mesh.ply").read_bytes() == (whole / "mesh.ply").read_bytes()
    assert (broken / "run.trace").read_bytes() == (whole / "run.trace").read_bytes()


@pytest.mark.slow
def test_ctrl_c_within_a_step_drops_that_step_alone(scene, tmp_path, monkeypatch):
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    assert fair(scene, whole, *FIRST) == 0
    linearise, step_after, calls, moments = Problem.linearise, Stepper.step_after, [], []

    def noted(self, moment):
        moments.append(moment)
        return step_after(self, moment)

    def interrupted(self, *arguments):
        calls.append(arguments)
        if len(calls) == 6:
            signal.raise_signal(signal.SIGINT)
        return linearise(self, *arguments)

    with monkeypatch.context() as patched:
        patched.setattr(Problem, "linearise", interrupted)
        patched.setattr(Stepper, "step_after", noted)
        assert fair(scene, broken, *FIRST) == 130
    assert len(Trace.load(broken / "run.trace")) == moments[-1] > 0
    assert fair(scene, broken, *FIRST, "--resume") == 0
    assert (broken / "run.trace").read_bytes() == (whole / "run.trace").read_bytes()


def test_ctrl_c_before_the_first_step_saves_the_start_without_another_look_at_the_photos(scene, tmp_path, monkeypatch):
    out, contexts = tmp_path / "out", []

    def interrupted(*arguments, **named):
        contexts.append(arguments)
        signal.raise_signal(signal.SIGINT)
        return build_context(*arguments, **named)

    monkeypatch.setattr("fairing.solve.problem.build_context", interrupted)
    assert fair(scene, out) == 130
    assert len(contexts) == 1
    report = json.loads((out / "report.json").read_text())
    assert not report["finished"]
    assert {vertex["stop_reason"] for vertex in report["vertices"]} == {"not reached"}
    assert all(vertex["start"] == vertex["end"] for vertex in report["vertices"])


def test_resume_refuses_other_options(scene, tmp_path, capsys):
    fair(scene, tmp_path / "out")
    capsys.readouterr()
    before = (tmp_path / "out" / "run.trace").read_bytes()
    assert fair(scene, tmp_path / "out", "--resume", "--step.prior", "0.3") == 1
    assert "step.prior was 0.1, now 0.3" in one_line(capsys)
    assert (tmp_path / "out" / "run.trace").read_bytes() == before


@pytest.mark.parametrize("limit", [1000, 40_000])
def test_a_full_disk_is_one_line_and_leaves_nothing_half_written(scene, tmp_path, capsys, limit):
    """A limit on file sizes fails as a full disk does; SIGXFSZ is ignored by Python."""
    out = tmp_path / "out"
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, hard))
    try:
        code = fair(scene, out, "--preset", "paper", "--schedule.max-iterations", "3")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    errors = [line for line in capsys.readouterr().err.splitlines() if line.startswith("eigenfairing:")]
    assert code == 1
    assert len(errors) == 1
    assert not list(out.glob("*.part"))
    assert (out / "mesh.ply").exists() == (limit > 1000)
    if (out / "run.trace").exists():
        assert len(Trace.load(out / "run.trace")) > 0


MISTAKES = {
    "nosuch": (["fair", "nosuch", "--out", "{out}"], "expected a demo"),
    "seed missing": (["fair", "building:", "--out", "{out}"], "expected an integer as the seed"),
    "seed no integer": (["check", "building:x"], "expected an integer as the seed"),
    "mesh of a demo": (["fair", "cube", "--mesh", "{scene}/mesh.obj", "--out", "{out}"], "has its own mesh"),
    "missing mesh": (["fair", "{scene}", "--mesh", "no.ply", "--out", "{out}"], "no.ply"),
    "folder in use": (["fair", "{scene}", "--out", "{scene}"], "empty or new folder"),
    "cell size": (["fair", "{scene}", "--out", "{out}", "--cells.size", "0"], "cells.size: expected at least 4"),
    "no blur": (["fair", "{scene}", "--out", "{out}", "--schedule.blur"], "schedule.blur: expected at least one"),
    "locked": (["fair", "{scene}", "--out", "{out}", "--locked-vertices", "99"], "expected numbers 0 to 7"),
    "no trace": (["replay", "{scene}"], "run.trace"),
    "not a trace": (["replay", "{scene}/mesh.obj"], "expected an EigenFairing trace"),
    "check": (["check", "{scene}/images", "--points", "none"], "expected"),
    "endless": (["fair", "{scene}", "--out", "{out}", "--step.prior", "nan"], "finite"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_one_line_and_exit_code_1(name, scene, tmp_path, capsys):
    arguments, expected = MISTAKES[name]
    before = sorted(scene.rglob("*"))
    assert run([a.format(scene=scene, out=tmp_path / "out") for a in arguments]) == 1
    assert expected in one_line(capsys)
    assert sorted(scene.rglob("*")) == before


@pytest.mark.parametrize(
    "arguments",
    [["fair", "cube"], ["nosuch"], ["fair", "cube", "--out", "x", "--preset", "best"], ["view", "--port", "x"]],
)
def test_wrong_usage_is_exit_code_2(arguments, capsys):
    with pytest.raises(SystemExit) as stopped:
        run(arguments)
    assert stopped.value.code == 2


def test_check_judges_a_good_scene_and_draws_the_mesh_over_its_photos(scene, tmp_path, capsys):
    assert run(["check", str(scene), "--out", str(tmp_path / "out")]) == 0
    text = capsys.readouterr().out
    assert "6 faces are seen by at least 3 photos" in text
    assert "verdict: good" in text
    found = json.loads((tmp_path / "out" / "check.json").read_text())
    assert found["verdict"] == "good"
    assert found["views_per_face"][0] >= 5
    assert found["views_per_face"][-1] == 8
    assert len(list((tmp_path / "out").glob("overlay-*.png"))) == 8


def test_check_says_why_a_scene_cannot_work(scene, capsys):
    for i in range(2, 8):
        (scene / "images" / f"photo{i}.png").unlink()
        (scene / "images" / f"photo{i}.txt").unlink()
    assert run(["check", str(scene)]) == 1
    assert "at least 3 photos, found 2" in one_line(capsys)


def test_check_finds_a_mesh_turned_inside_out_usable_and_a_distant_one_too_small(scene, tmp_path, capsys):
    vertices, faces = read_mesh(scene / "mesh.obj")
    lines = [f"v {x / 50} {y / 50} {z / 50}" for x, y, z in vertices]
    lines += [f"f {c} {b} {a}" for a, b, c in (faces + 1).tolist()]
    (tmp_path / "far.obj").write_text("\n".join(lines))
    assert run(["check", str(scene), "--mesh", str(tmp_path / "far.obj")]) == 1
    text = capsys.readouterr().out
    assert "too small in the photos" in text
    assert "verdict: unusable" in text


def test_load_scene_and_the_command_agree_on_the_scene(scene):
    assert load_scene(scene).name == SceneSource.typed(str(scene), None).load().name == "corner"


def test_demos_are_listed(capsys):
    assert run(["demos"]) == 0
    names = [line.split()[0] for line in capsys.readouterr().out.splitlines()]
    assert names == ["cube", "facade", "archway", "dome", "building:SEED"]


@pytest.mark.slow
def test_the_module_runs_as_a_command():
    done = subprocess.run(
        [sys.executable, "-m", "app", "--help"],
        capture_output=True,
        text=True,
        env=os.environ,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0
    assert "Without a command" in done.stdout


@pytest.mark.slow
def test_a_reader_of_the_output_that_ends_is_no_error():
    process = subprocess.Popen(
        [sys.executable, "-m", "app", "fair", "--help"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    process.stdout.close()
    assert process.stderr is not None
    assert process.stderr.read() == ""
    process.wait(300)


@pytest.mark.slow
def test_ctrl_c_ends_the_debugger_cleanly_with_the_run_saved(scene, tmp_path):
    command = [sys.executable, "-m", "app", "view", str(scene), "--no-browser", "--at", "end", "--points", "none"]
    process = subprocess.Popen(
        [*command, "--port", "0", "--save-to", str(tmp_path / "run.trace")],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert "http://127.0.0.1:" in process.stdout.readline()
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=300)
    assert process.returncode == 0
    assert "Traceback" not in errors
    session = Session(load_scene(scene), trace=Trace.load(tmp_path / "run.trace"))
    assert session.finished


@pytest.mark.slow
def test_the_debugger_says_its_address_before_it_imports_the_engine():
    """A browser unpacks the viewer meanwhile; what a command line needs until then is quick to import."""
    script = "import sys, app.cli.main, app.cli.serve; print(*sorted({'numba', 'trimesh', 'scipy'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, env=os.environ, check=True)
    assert done.stdout.split() == []


def test_a_folder_that_is_no_scene_is_one_line_without_an_address(tmp_path, capsys):
    assert run(["view", str(tmp_path), "--no-browser", "--port", "0"]) == 1
    said = capsys.readouterr()
    assert said.out == ""
    assert len(said.err.splitlines()) == 1


def test_a_scene_that_cannot_be_opened_is_one_line_after_the_address(scene, capsys):
    (scene / "other.obj").write_bytes((scene / "mesh.obj").read_bytes())
    assert run(["view", str(scene), "--no-browser", "--port", "0"]) == 1
    said = capsys.readouterr()
    assert "http://127.0.0.1:" in said.out
    assert len(said.err.splitlines()) == 1


def test_flags_of_options_that_runs_no_longer_have_are_noted_and_without_effect():
    typed = [
        "fair",
        "--schedule.start-error",
        "-1",
        "cube",
        "--schedule.search=0",
        "--schedule.sweeps-near-truth",
        "1",
        "2",
        "--step.prior-threshold=0.3",
        "--eigenspace.significance",
        "0.0",
        "6.0",
    ]
    arguments, notes = with_current_flags([*typed, "--out", "3", "--schedule.start", "first"])
    assert arguments == ["fair", "cube", "--out", "3", "--schedule.first-level", "first"]
    assert [note.split()[0] for note in notes] == [
        "--schedule.start-error",
        "--schedule.search",
        "--schedule.sweeps-near-truth",
        "--step.prior-threshold",
        "--eigenspace.significance",
    ]
    assert "step.prior" in notes[3]
