"""The child process that places photos, seen from its parent: started, followed, cancelled, and its end put into words."""

import json
import os
import queue
import signal
import sqlite3
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fairing
from fairing.errors import Cancelled, InputError
from fairing.structure.worker import DATABASE, FACTS, LOG

COMMAND = (sys.executable, "-m", "fairing.structure.worker")
POLL = 0.2  # seconds between looks at cancellation
COUNT_EVERY = 1.0  # seconds between looks into the database


@dataclass(frozen=True)
class _Stage:
    """A stage of the worker.

    Attributes:
        line: with the number of finished parts and of all parts.
        seconds: processor time of a part, at 1600 px, as measured on SceauxCastle: what the remaining time is estimated by.
        table: of the database, with a row for each finished part; None if the worker counts them.
    """

    line: str
    seconds: float
    table: str | None = None


_STAGES = {
    "features": _Stage("finding features: photo {done} of {count}", 3.6, "keypoints"),
    "pairs": _Stage("finding similar photos: {done} of {count}", 0.1),
    "matches": _Stage("matching features: pair {done} of {count}", 0.33, "two_view_geometries"),
    "mapping": _Stage("placing cameras: {done} of {count}", 1.1),
}


def place_photos(
    work: Path,
    n_photos: int,
    n_pairs: int,
    on_progress: Callable[[float, str], None],
    cancel_requested: Callable[[], bool],
) -> dict[str, Any]:
    """Run the worker on a working folder; what an earlier run has put into the database is used.

    Args:
        n_photos, n_pairs: about how many will be matched, to estimate the remaining time.

    Returns:
        The worker's facts, see `fairing.structure.outcome`.

    Raises:
        InputError: the worker failed, or its native code crashed.
        Cancelled: `cancel_requested` returned True; the worker has ended.
    """
    expected = {"features": n_photos, "pairs": n_photos, "matches": n_pairs, "mapping": n_photos}
    total = sum(_STAGES[name].seconds * count for name, count in expected.items())
    stage, count, done, before, error = "", 1, 0, 0.0, None
    with (work / LOG).open("ab") as log:
        process = subprocess.Popen(
            [*COMMAND, str(work)],
            stdin=subprocess.PIPE,  # its end ends the process
            stdout=subprocess.PIPE,
            stderr=log,
            env=os.environ | {"PYTHONPATH": _with_package(os.environ.get("PYTHONPATH"))},
        )
    try:
        lines, is_finished, next_count = _lines_of(process), False, 0.0
        while True:
            if cancel_requested():
                raise Cancelled
            with suppress(queue.Empty):
                line = lines.get(timeout=POLL)
                if line is None:
                    break
                message = _parsed(line)
                if "stage" in message:
                    before += _STAGES[stage].seconds * expected[stage] if stage else 0.0
                    stage, count, done = message["stage"], max(message["count"], 1), 0
                done = message.get("done", done)
                error = message.get("error", error)
                is_finished = is_finished or "finished" in message
            table = _STAGES[stage].table if stage else None
            if table is not None and time.monotonic() >= next_count:
                done, next_count = _rows(work / DATABASE, table, done), time.monotonic() + COUNT_EVERY
            if stage:
                done = min(done, count)
                fraction = (before + _STAGES[stage].seconds * expected[stage] * done / count) / total
                on_progress(min(fraction, 1.0), _STAGES[stage].line.format(done=done, count=count))
        code = process.wait()
    finally:
        if process.poll() is None:
            process.kill()
        process.wait()
        for stream in (process.stdin, process.stdout):
            if stream is not None:
                stream.close()
    if error is not None or not is_finished:
        raise InputError(_failure(error, code, stage, work / LOG))
    return json.loads((work / FACTS).read_text(encoding="utf-8"))


def _failure(error: str | None, code: int, stage: str, log: Path) -> str:
    """Why the worker did not finish, in a line."""
    while_doing = _STAGES[stage].line.partition(":")[0] if stage else "starting"
    if error is not None:
        return f"pycolmap failed while {while_doing}: {error}; its messages are in {log}"
    end = f"exit code {code}"
    if code < 0:
        with suppress(ValueError):
            end = signal.Signals(-code).name
    remedy = "perhaps for lack of memory: close other programs, or try a smaller --largest-side"
    return (
        f"pycolmap ended unexpectedly ({end}) while {while_doing}, {remedy}; the same command continues there; its messages are "
        f"in {log}"
    )


def _lines_of(process: "subprocess.Popen[bytes]") -> "queue.SimpleQueue[bytes | None]":
    """The lines of the process's standard output as they come, and None at its end."""
    lines: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
    stream = process.stdout
    assert stream is not None

    def read() -> None:
        with suppress(ValueError):  # closed
            for line in stream:
                lines.put(line)
        lines.put(None)

    threading.Thread(target=read, daemon=True, name="lines of pycolmap").start()
    return lines


def _parsed(line: bytes) -> dict[str, Any]:
    """The message of a line; empty for anything else."""
    try:
        message = json.loads(line)
    except ValueError:
        return {}
    return message if isinstance(message, dict) and message.get("stage", "features") in _STAGES else {}


def _rows(database: Path, table: str, otherwise: int) -> int:
    """The number of rows of a table, read in this process: two libraries of SQLite in one would drop each other's locks."""
    try:
        with closing(sqlite3.connect(f"{database.absolute().as_uri()}?mode=ro", uri=True, timeout=POLL)) as connection:
            return int(connection.execute(f"SELECT COUNT(*) FROM {table}").fetchone()[0])
    except sqlite3.Error:
        return otherwise


def _with_package(path: str | None) -> str:
    """A search path of modules on which the worker finds this package."""
    root = str(Path(str(fairing.__file__)).parents[1])
    return root if not path else f"{root}{os.pathsep}{path}"
