"""Runs ended at the worst moments: nothing half-written is read, and the resumed run writes the same bytes."""

import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import pytest

from fairing.run.session import Session
from fairing.trace import Trace
from fairing.util import block_file
from fairing.util.block_file import BlockFile
from tests.small_scene import corner_scene, small_options


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["write", "resume", "full disk"])
def test_a_run_that_was_ended_resumes_to_the_same_bytes(kind: str):
    """In a process of its own: forking is safe only where no threads run."""
    command = [sys.executable, "-m", "tests.kills", "--times", "1", "--kind", kind]
    done = subprocess.run(command, capture_output=True, text=True, timeout=900, cwd=Path(__file__).parents[1])
    assert done.returncode == 0, done.stdout + done.stderr
    assert "1 runs ended" in done.stdout
    assert "0 failed" in done.stdout


def test_every_step_reaches_the_file_before_the_next_one(tmp_path: Path):
    """Within a sweep, too, and without a flush: a killed process loses no step that is done."""
    session = Session(corner_scene(), small_options(schedule={"order": "sequential"}))
    session.trace.attach(tmp_path / "run.trace")
    for done in range(1, 12):
        record = session.step()
        assert record is not None
        assert record.next_position[:2] == (0, 0), "still the first sweep"
        assert len(Trace.load(tmp_path / "run.trace")) == done
    session.trace.detach()


@pytest.mark.slow
def test_thousands_of_steps_within_a_sweep_reach_the_file_one_by_one(tmp_path: Path):
    """The file only grows: writing a step neither waits for the end of a sweep nor takes longer after many others."""
    session = Session(corner_scene(), small_options(schedule={"order": "sequential"}))
    record = session.step()
    assert record is not None
    assert record.next_position[:2] == record.position[:2], "within a sweep"
    session.trace.attach(tmp_path / "run.trace")
    written = (tmp_path / "run.trace").read_bytes()
    for done in range(2, 2001):
        session.trace.append(record)
        if done in (999, 2000):
            data = (tmp_path / "run.trace").read_bytes()
            assert data.startswith(written)
            written = data
            assert len(Trace.load(tmp_path / "run.trace")) == done
    session.trace.detach()


def test_the_disk_is_asked_to_keep_steps_about_once_a_second(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A power failure loses the work of a second at most; syncing after each of many short steps would cost too much."""
    now, synced = [100.0], []
    file = BlockFile(tmp_path / "a", b"magic\n", [b"header"])
    monkeypatch.setattr(block_file.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(block_file.os, "fsync", lambda _: synced.append(now[0]))
    file.flush()
    for _ in range(35):
        now[0] += 0.1
        file.append(b"step")
    file.close()
    assert 4 <= len(synced) <= 6
    assert max(b - a for a, b in pairwise(synced)) < 1.25
