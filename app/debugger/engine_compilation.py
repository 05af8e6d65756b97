"""Engine compilation: compiles the engine at its first start, in processes of its own beside the opening of the scene.

numba compiles one function at a time in a process, and keeps the result on disk: this process finds the compiled functions
there afterwards. See `app.debugger.engine_compiler` for what the processes do.
"""

import subprocess
import sys
import threading
import time
from collections.abc import Callable
from typing import NamedTuple

from app.debugger import engine_compiler
from app.debugger.engine_compiler import READY, Part
from app.debugger.work_report import WorkReport
from fairing.errors import Cancelled

POLL = 0.1  # s


class Compiled(NamedTuple):
    """What the process that compiles the steps has reported so far.

    Attributes:
        done: number of functions that have been begun.
        total: number of functions of a step; 0 before it is known.
    """

    done: int = 0
    total: int = 0


class EngineCompilation:
    """The processes, from their start. They end with this one; if one fails, functions are compiled where they are used."""

    def __init__(self) -> None:
        self.compiled = Compiled()
        self._began = time.monotonic()
        self._ready = {part: threading.Event() for part in Part}
        self._processes = {part: _started(part) for part in Part}
        for part in Part:
            threading.Thread(target=self._follow, args=(part,), name=f"compilation: {part}", daemon=True).start()

    @property
    def report(self) -> WorkReport | None:
        """What is done; None once a step can be made."""
        if self._ready[Part.STEPS].is_set():
            return None
        seconds, (done, total) = round(time.monotonic() - self._began), self.compiled
        which = f": {done} of {total}" if total else ""
        return WorkReport(f"compiling the engine, first start{which}", done / max(1, total), seconds=seconds)

    def wait(self, cancelled: Callable[[], bool]) -> None:
        """Wait until a step can be made.

        Raises:
            Cancelled: `cancelled` returned True.
        """
        while not self._ready[Part.STEPS].wait(POLL):
            if cancelled():
                raise Cancelled

    def wait_for_painting(self) -> None:
        """Wait until what paints the mesh is compiled, too: compiled twice at a time, it would delay the first step."""
        self._ready[Part.SURFACES].wait()

    def close(self) -> None:
        """End the processes."""
        for part, process in self._processes.items():
            process.kill()
            self._ready[part].wait(5)

    def _follow(self, part: Part) -> None:
        with self._processes[part] as process:
            assert process.stdout is not None
            for line in process.stdout:
                done, _, count = line.strip().partition(" ")
                if done == READY:
                    self._ready[part].set()  # nothing waits for what the process compiles further
                elif done.isdigit() and count.isdigit():
                    self.compiled = Compiled(int(done), int(count))
            self._ready[part].set()


def _started(part: Part) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [sys.executable, "-m", engine_compiler.__name__, part],
        stdin=subprocess.PIPE,  # its end ends the process
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
