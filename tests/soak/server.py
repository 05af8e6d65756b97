"""The server's process as the test sees it: its address, its state, and what it uses."""

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from tests.soak.served import Facts

PAGE_BYTES = 4096


@dataclass(frozen=True)
class Sample:
    """Attributes:
    minutes: since the start.
    memory: resident, MB.
    allocated, blocks: as in `Facts`, at the last action.
    """

    minutes: float
    memory: float
    allocated: float
    blocks: int
    threads: int
    descriptors: int


class Server:
    """A process with `tests.soak.served`.

    Attributes:
        url: address of the debugger.
    """

    def __init__(self) -> None:
        command = [sys.executable, "-m", "tests.soak.served"]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.url = self._read()
        self._latest = self.facts()

    def facts(self) -> Facts:
        """The present state."""
        assert self._process.stdin is not None
        self._process.stdin.write("\n")
        self._process.stdin.flush()
        self._latest = Facts(**json.loads(self._read()))
        return self._latest

    def sample(self, minutes: float) -> Sample:
        """What the process uses now."""
        process = Path(f"/proc/{self._process.pid}")
        return Sample(
            minutes,
            int((process / "statm").read_text().split()[1]) * PAGE_BYTES / 1e6,
            self._latest.allocated,
            self._latest.blocks,
            len(list((process / "task").iterdir())),
            len(list((process / "fd").iterdir())),
        )

    def close(self) -> None:
        """End the process."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait(timeout=300)

    def _read(self) -> str:
        assert self._process.stdout is not None
        line = self._process.stdout.readline().strip()
        assert line, "the server's process has ended"
        return line
