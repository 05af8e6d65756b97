"""Killing runs, checking what they leave behind, and resuming them."""

import json
import os
import shutil
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from fairing.io import read_mesh
from fairing.trace import Trace
from tests.kills.child import FULL, kill_at_rename, kill_within_write, limit_file_size, run_in_child
from tests.small_scene import write_corner

KINDS = ("moment", "rename", "write", "resume", "full disk", "full folder")
"""How a run ends; "full folder" needs the right to mount a tmpfs, and is a full disk otherwise."""
_RENAMES = 4  # of a run: trace, mesh, report, and one more that does not come
_LIMITS = (2_000, 400_000)  # bytes a file may have on a full disk
_FOLDER = (48, 400)  # KiB of the small tmpfs


class Reference:
    """A run that was never ended.

    Attributes:
        scene: folder of the scene.
        trace: bytes of its trace.
        mesh: bytes of its mesh.
        steps: number of steps.
        seconds: how long it took.
    """

    def __init__(self, folder: Path) -> None:
        self.folder, self.scene = folder, folder / "scene"
        write_corner(self.scene)
        for name in ("warm", "out"):  # the first one loads compiled code
            began = time.monotonic()
            pid = run_in_child(self.scene, folder / name, folder / f"{name}.steps", False, lambda: None)
            _, status = os.waitpid(pid, 0)
            assert status == 0, f"the run that was not killed exits with status {status}"
            self.seconds = time.monotonic() - began
        out = folder / "out"
        self.trace, self.mesh = (out / "run.trace").read_bytes(), (out / "mesh.ply").read_bytes()
        self.loaded = Trace.load(out / "run.trace")
        self.steps = len(self.loaded)
        assert (folder / "warm" / "run.trace").read_bytes() == self.trace


def kill_and_resume(reference: Reference, kind: str, rng: np.random.Generator, folder: Path) -> str:
    """End a run as the kind says, check its folder, resume it, and compare it with the reference.

    Returns:
        What happened, in a few words.

    Raises:
        AssertionError: something half-written was found, too many steps were lost, or the bytes differ.
    """
    out, steps_done = folder / "out", folder / "steps"
    folder.mkdir()
    is_mounted = kind == "full folder" and _mount(out, int(rng.integers(*_FOLDER)))
    try:
        first = "write" if kind == "resume" else kind
        done = _end(reference, first, rng, out, steps_done, resume=False, is_mounted=is_mounted)
        kept = check_folder(reference, out, done)
        story = f"{first}: {done} of {reference.steps} steps done, {kept} kept"
        if kind == "resume":
            for second in ("rename", "write", "moment")[: rng.integers(1, 4)]:
                done = max(kept, _end(reference, second, rng, out, steps_done, resume=True))
                kept = check_folder(reference, out, done)
                story += f"; resumed, {second}: {kept} kept"
        if is_mounted:
            subprocess.run(["mount", "-o", "remount,size=64m", str(out)], check=True)
        pid = run_in_child(reference.scene, out, steps_done, True, lambda: None)
        _, status = os.waitpid(pid, 0)
        assert status == 0, f"the resumed run exits with status {status}"
        assert (out / "run.trace").read_bytes() == reference.trace, "the resumed trace has other bytes"
        assert (out / "mesh.ply").read_bytes() == reference.mesh, "the resumed mesh has other bytes"
        assert not list(out.rglob("*.part")), f"part files are left: {list(out.rglob('*.part'))}"
        return story
    finally:
        if is_mounted:
            subprocess.run(["umount", str(out)], check=True)
        shutil.rmtree(folder, ignore_errors=True)


def check_folder(reference: Reference, out: Path, done: int) -> int:
    """Read everything in the folder of a run that was ended; returns the number of steps kept.

    Args:
        done: steps that the run had done.

    Raises:
        AssertionError: a file is not complete, or more than one step is lost.
    """
    if not out.exists():
        return 0
    for path in out.rglob("*"):
        if path.suffix == ".ply":
            vertices, _ = read_mesh(path)
            assert len(vertices) == 8, f"{path.name} holds {len(vertices)} vertices"
        elif path.suffix == ".json":
            assert json.loads(path.read_text())
    if not (out / "run.trace").exists():
        assert done <= 1, f"{done} steps were done, and there is no trace"
        return 0
    trace = Trace.load(out / "run.trace")
    for record, expected in zip(trace.steps, reference.loaded.steps, strict=False):
        assert np.array_equal(record.after, expected.after)
        assert record.position == expected.position
    assert len(trace) >= done - 1, f"{done} steps were done, {len(trace)} kept"
    return len(trace)


def _end(
    reference: Reference,
    kind: str,
    rng: np.random.Generator,
    out: Path,
    steps_done: Path,
    resume: bool,
    is_mounted: bool = False,
) -> int:
    """Run until the end that the kind says; returns the number of steps done in this run and the kept ones before it."""
    before = len(Trace.load(out / "run.trace")) if resume and (out / "run.trace").exists() else 0
    steps_done.unlink(missing_ok=True)
    prepare: Callable[[], None] = lambda: None  # noqa: E731
    if kind == "rename":
        number, is_after = int(rng.integers(_RENAMES)), bool(rng.integers(2))
        prepare = lambda: kill_at_rename(number, is_after)  # noqa: E731
    elif kind == "write":
        number, share = int(rng.integers(reference.steps)), float(rng.random())
        prepare = lambda: kill_within_write(number, share)  # noqa: E731
    elif kind == "full disk" or (kind == "full folder" and not is_mounted):
        limit = int(rng.integers(*_LIMITS))
        prepare = lambda: limit_file_size(limit)  # noqa: E731
    pid = run_in_child(reference.scene, out, steps_done, resume, prepare)
    if kind == "moment":
        _wait_for_moment(reference, rng, steps_done)
        os.kill(pid, signal.SIGKILL)  # a process that has ended is still there until waited for
    _, status = os.waitpid(pid, 0)
    code = os.waitstatus_to_exitcode(status)
    assert code in (0, FULL, -signal.SIGKILL), f"the run exits with status {code}"
    made = steps_done.stat().st_size if steps_done.exists() else 0
    # On a full disk a run ends with the step that could not be written; it is computed again.
    return min(before + made, reference.steps)


def _wait_for_moment(reference: Reference, rng: np.random.Generator, steps_done: Path) -> None:
    """Wait until a random number of steps is done and a few milliseconds more; or, one time in five, a random time."""
    if rng.random() < 0.2:
        time.sleep(float(rng.uniform(0, reference.seconds)))
        return
    wanted, deadline = int(rng.integers(reference.steps)), time.monotonic() + 10 * reference.seconds
    while time.monotonic() < deadline and not (steps_done.exists() and steps_done.stat().st_size >= wanted):
        time.sleep(0.002)
    time.sleep(float(rng.uniform(0, 0.03)))


def _mount(folder: Path, kib: int) -> bool:
    """Whether a tmpfs of this size could be mounted there."""
    folder.mkdir(parents=True, exist_ok=True)
    command = ["mount", "-t", "tmpfs", "-o", f"size={kib}k", "tmpfs", str(folder)]
    try:
        return subprocess.run(command, capture_output=True).returncode == 0
    except OSError:
        return False
