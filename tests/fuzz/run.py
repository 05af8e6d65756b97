"""Running cases in forked workers with limits on time and memory."""

import os
import pickle
import resource
import select
import shutil
import signal
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fairing.errors import InputError
from tests.fuzz.mutations import mutate
from tests.fuzz.seeds import Seed, copy_for_case

SECONDS = 120.0
"""Longest a case may take; on an idle machine they take milliseconds to a second, on an overloaded one 20 times longer."""
MEMORY = 6 << 30
"""Bytes of address space of a worker; numba, OpenBLAS and embree reserve most of it."""


@dataclass(frozen=True)
class Outcome:
    """What became of a case.

    Attributes:
        number: the case's number.
        name: its seed and the mutated file.
        kind: "read", "refused" or "failed".
        text: the message of a refusal, the traceback of a failure.
    """

    number: int
    name: str
    kind: str
    text: str = ""


def run_cases(
    seeds: list[Seed],
    numbers: Iterable[int],
    workers: int,
    on_outcome: Callable[[Outcome], None],
    keep: Path | None = None,
) -> None:
    """Run cases in forked workers.

    Args:
        on_outcome: called for every case.
        keep: folder that the mutated input of failed cases is copied to.
    """
    waiting = sorted(numbers, reverse=True)
    with tempfile.TemporaryDirectory() as scratch:
        shares = [waiting[i::workers] for i in range(workers)]
        running = [_Worker(seeds, share, Path(scratch) / str(i)) for i, share in enumerate(shares) if share]
        while running:
            ready, _, _ = select.select([worker.results for worker in running], [], [], 1.0)
            for worker in list(running):
                outcomes, has_ended = worker.outcomes(worker.results in ready)
                for outcome in outcomes:
                    if outcome.kind == "failed" and keep is not None:
                        _keep(seeds, outcome, keep)
                    on_outcome(outcome)
                if has_ended:
                    running.remove(worker)


def prepare_case(seeds: list[Seed], number: int, folder: Path) -> tuple[Seed, str, float]:
    """Write the mutated input of a case; returns its seed, the mutated file and its random number for `Seed.use`."""
    rng = np.random.default_rng([7, number])
    seed = seeds[rng.integers(len(seeds))]
    name = seed.files[rng.integers(len(seed.files))]
    chance = float(rng.random())
    copy_for_case(seed, folder)
    data = (folder / name).read_bytes()
    (folder / name).unlink()  # a link to the seed's own
    (folder / name).write_bytes(mutate(data, name, rng))
    return seed, name, chance


def judge(seed: Seed, folder: Path, chance: float) -> tuple[str, str]:
    """Use an input: "read", "refused" with the message, or "failed" with the traceback."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)
            seed.use(folder, chance)
    except InputError as error:
        message = str(error)
        is_clear = message and "\n" not in message and len(message) < 2000
        return ("refused", message) if is_clear else ("failed", f"unclear message: {message!r}")
    except BaseException:
        return "failed", traceback.format_exc()
    return "read", ""


class _Worker:
    """A forked process that works off its cases; it is started anew after one that hung or crashed."""

    def __init__(self, seeds: list[Seed], numbers: list[int], folder: Path) -> None:
        self._seeds, self._numbers, self._folder = seeds, numbers, folder
        self._start()

    def _start(self) -> None:
        self.results, writing = os.pipe()
        self._received, self._deadline = b"", time.monotonic() + SECONDS
        self._pid = os.fork()
        if self._pid == 0:
            os.close(self.results)
            try:
                _work(self._seeds, list(self._numbers), self._folder, writing)
            finally:
                os._exit(0)
        os.close(writing)

    def outcomes(self, is_ready: bool) -> tuple[list[Outcome], bool]:
        """What has come since the last call, and whether all is done."""
        if is_ready:
            data = os.read(self.results, 1 << 20)
            if not data:
                return self._after_end()
            self._received += data
        found = []
        while len(self._received) >= 4 and len(self._received) >= 4 + (
            size := int.from_bytes(self._received[:4], "little")
        ):
            found.append(pickle.loads(self._received[4 : 4 + size]))
            self._received = self._received[4 + size :]
            self._numbers.pop()
            self._deadline = time.monotonic() + SECONDS
        if time.monotonic() > self._deadline:
            os.kill(self._pid, signal.SIGKILL)
            more, has_ended = self._after_end(f"no result within {SECONDS:g} s")
            return [*found, *more], has_ended
        return found, False

    def _after_end(self, why: str = "") -> tuple[list[Outcome], bool]:
        _, status = os.waitpid(self._pid, 0)
        os.close(self.results)
        if not self._numbers:
            return [], True
        why = why or f"the process ended with status {os.waitstatus_to_exitcode(status)}"
        failed = Outcome(self._numbers.pop(), "", "failed", why)
        if self._numbers:
            self._start()
        return [failed], not self._numbers


def _work(seeds: list[Seed], numbers: list[int], folder: Path, writing: int) -> None:
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    silent = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(silent, stream)
    while numbers:
        number = numbers.pop()
        seed, name, chance = prepare_case(seeds, number, folder)
        outcome = pickle.dumps(Outcome(number, f"{seed.name}: {name}", *judge(seed, folder, chance)))
        os.write(writing, len(outcome).to_bytes(4, "little") + outcome)


def _keep(seeds: list[Seed], outcome: Outcome, keep: Path) -> None:
    """The whole input of a failed case, to be looked at and turned into a regression."""
    with tempfile.TemporaryDirectory() as scratch:
        seed, name, _ = prepare_case(seeds, outcome.number, Path(scratch) / "case")
        target = keep / f"{outcome.number}"
        if target.exists():
            shutil.rmtree(target)
        shutil.copytree(Path(scratch) / "case", target)
        (target / "failure.txt").write_text(f"{replace(outcome, name=f'{seed.name}: {name}')}\n{outcome.text}")
