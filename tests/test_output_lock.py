"""A folder of results is written by one process at a time."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from app.cli.main import run
from fairing.errors import InputError
from fairing.io import locked_output_folder
from tests.small_scene import write_corner

HOLD = """
import sys
from pathlib import Path
from fairing.io import locked_output_folder
with locked_output_folder(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""
COMMANDS = {
    "fair": ["fair", "SCENE"],
    "check": ["check", "SCENE"],
    "convert": ["convert", "SCENE"],
    "points": ["points", "SCENE"],
    "experiment": ["experiment", "noise", "cube"],
    "demos": ["demos", "--scan"],
}
QUICK = ["--points", "none", "--schedule.max-sweeps", "1"]


@contextmanager
def held_by_another_process(folder: Path) -> Iterator[subprocess.Popen[str]]:
    child = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(folder)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert child.stdout is not None
    assert child.stdout.readline() == "held\n"
    try:
        yield child
    finally:
        child.kill()
        child.wait()


def contents(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    write_corner(tmp_path / "corner")
    return tmp_path / "corner"


@pytest.mark.slow
def test_a_folder_in_use_is_refused_with_one_line_by_every_command(scene: Path, tmp_path: Path, capsys):
    out = tmp_path / "out"
    with held_by_another_process(out):
        for name, command in COMMANDS.items():
            arguments = [str(scene) if word == "SCENE" else word for word in command]
            flag = [str(out)] if name == "demos" else ["--out", str(out)]
            assert run([*arguments, *flag]) == 1, name
            assert capsys.readouterr().err == (
                f"eigenfairing: {out}: another process is writing its results there; wait for its end, or choose "
                "another folder\n"
            ), name
        assert contents(out) == [".eigenfairing"]


def test_a_process_that_was_killed_leaves_no_lock(tmp_path: Path):
    with held_by_another_process(tmp_path / "out") as child:
        child.kill()
        child.wait()
        with locked_output_folder(tmp_path / "out"):
            pass


def test_a_second_block_of_the_same_process_is_refused(tmp_path: Path):
    with locked_output_folder(tmp_path / "out"):
        with pytest.raises(InputError, match="another process"), locked_output_folder(tmp_path / "out"):
            pass
        (tmp_path / "out" / "mesh.ply").write_text("result")
    with locked_output_folder(tmp_path / "out"):
        pass
    assert contents(tmp_path / "out") == [".eigenfairing", "mesh.ply"]


def failing_command(out: Path, *written: str) -> None:
    with locked_output_folder(out):
        for name in written:
            (out / name).write_text("result")
        raise InputError("the command failed")


def test_a_new_folder_stays_only_if_something_was_written(tmp_path: Path):
    (tmp_path / "ours").mkdir()
    for name, written, stays in (("new", [], False), ("used", ["mesh.ply"], True), ("ours", [], True)):
        with pytest.raises(InputError, match="the command failed"):
            failing_command(tmp_path / name, *written)
        assert (tmp_path / name).exists() == stays


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="kills by signal")
def test_of_two_runs_into_one_folder_one_is_refused_and_the_other_goes_on(scene: Path, tmp_path: Path, capsys):
    out = tmp_path / "out"
    command = [sys.executable, "-m", "app", "fair", str(scene), "--out", str(out), "--points", "none"]
    first = subprocess.Popen([*command, "--schedule.max-sweeps", "500", "--step.tolerance", "0"])
    try:
        due = time.monotonic() + 240
        while not (out / "run.trace").exists():
            assert time.monotonic() < due
            assert first.poll() is None
            time.sleep(0.05)
        assert run(["fair", str(scene), "--out", str(out), *QUICK]) == 1
        assert "another process is writing its results there" in capsys.readouterr().err
        assert first.poll() is None
    finally:
        os.kill(first.pid, signal.SIGKILL)
        first.wait()
    assert run(["fair", str(scene), "--out", str(out), *QUICK]) == 0
