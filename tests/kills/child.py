"""The run that is killed: in a forked process, with the means to end at a chosen moment."""

import io
import os
import resource
import signal
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rich.console import Console

from app.cli.fair import fair_to_folder
from app.cli.run_extras import RunExtras
from app.files.scene_source import SceneSource
from fairing.errors import InputError
from fairing.run.session import Session
from fairing.util import block_file
from tests.small_scene import small_options

OPTIONS = small_options(schedule={"order": "sequential", "max_sweeps": [2], "max_iterations": [2]})
"""Some hundred steps in a few sweeps."""
FULL = 3
"""Exit code of a run that ended with one line, as on a full disk."""


def run_in_child(scene: Path, out: Path, steps_done: Path, resume: bool, prepare: Callable[[], None]) -> int:
    """Fork and fair the scene; returns the child's process id.

    Args:
        steps_done: file that grows by a byte with every step done.
        prepare: called in the child before the run.
    """
    pid = os.fork()
    if pid:
        return pid
    code = 1
    try:
        os.setpgid(0, 0)
        counter = os.open(steps_done, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
        _call_after(Session, "step", lambda: os.write(counter, b"."))
        prepare()
        source, console = SceneSource.typed(str(scene), None), Console(file=io.StringIO())
        code = fair_to_folder(source, out, "accurate", OPTIONS, resume, RunExtras(), console)
    except InputError:
        code = FULL
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(code)


def kill_at_rename(number: int, is_after: bool) -> None:
    """In this process: SIGKILL before or after the rename of this number, from 0."""
    replace, seen = Path.replace, [0]

    def counted(self: Path, target: Any) -> Path:
        is_due = seen[0] == number
        seen[0] += 1
        if is_due and not is_after:
            _die()
        result = replace(self, target)
        if is_due:
            _die()
        return result

    Path.replace = counted  # type: ignore[method-assign]


def kill_within_write(number: int, share: float) -> None:
    """In this process: SIGKILL when a share of the block of this number, from 0, has reached the trace."""
    write, seen = block_file._write_block, [0]

    def counted(file: Any, payload: bytes) -> None:
        is_due = seen[0] == number
        seen[0] += 1
        if not is_due:
            return write(file, payload)
        whole = io.BytesIO()
        write(whole, payload)  # type: ignore[arg-type]
        file.write(whole.getvalue()[: int(share * len(whole.getvalue()))])
        file.flush()
        return _die()

    block_file._write_block = counted


def limit_file_size(n_bytes: int) -> None:
    """In this process: writing more into a file fails, as on a full disk."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (n_bytes, n_bytes))


def _call_after(owner: Any, name: str, call: Callable[[], object]) -> None:
    original = getattr(owner, name)

    def wrapped(*args: Any, **kwargs: Any) -> Any:
        result = original(*args, **kwargs)
        call()
        return result

    setattr(owner, name, wrapped)


def _die() -> None:
    os.kill(os.getpid(), signal.SIGKILL)
