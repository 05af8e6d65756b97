"""Fuzzing: 1,000 cases, every input that ever failed, and failures of each kind that the workers must notice."""

import os
import signal
import subprocess
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from fairing.errors import InputError
from tests.fuzz import run as fuzz_run
from tests.fuzz.run import Outcome, judge, run_cases
from tests.fuzz.seeds import Seed, make_seeds


@pytest.fixture(scope="module")
def seeds(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Seed]:
    return {seed.name: seed for seed in make_seeds(tmp_path_factory.mktemp("seeds"))}


@pytest.mark.slow
def test_a_thousand_cases_are_read_or_refused_in_one_line(tmp_path: Path):
    """In a process of its own: forking is safe only where no threads run."""
    command = [sys.executable, "-m", "tests.fuzz", "--cases", "1000", "--keep", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=900, cwd=Path(__file__).parents[1])
    assert done.returncode == 0, done.stdout + done.stderr
    assert "1000 cases in" in done.stdout


def test_every_seed_is_valid(seeds: dict[str, Seed]):
    for seed in seeds.values():
        assert judge(seed, seed.folder, 1.0) == ("read", ""), seed.name


def replaced(file: str, old: str, new: str) -> Callable[[Path], None]:
    def damage(folder: Path) -> None:
        text = (folder / file).read_text()
        assert old in text
        (folder / file).write_text(text.replace(old, new, 1))

    return damage


REGRESSIONS = {
    "a number of 5000 digits": ("Middlebury", replaced("small_par.txt", "110.0", "1" + "0" * 5000)),
    "K of infinity after its scale": ("Middlebury", replaced("small_par.txt", " 1.0 ", " 1e-320 ")),
    "a color that is no number": ("Meshroom", replaced("cameras.sfm", '"color": ["0"', '"color": ["nan"')),
    "a sighting at 1e31 px": ("matches", replaced("matches.txt", "a.png ", "a.png 4.5e31 1 b.png 3e31 ")),
    "a camera without numbers": ("VisualSFM", replaced("scene.nvm", "\t110.0", "\t")),
    "a shift of 1e200": ("Metashape", replaced("cameras.xml", "<scale>1.0", "<scale>1e200")),
    "a world point at 1e90": ("matches", replaced("matches.txt", "-0.3", "8e90")),
}


@pytest.mark.parametrize("what", REGRESSIONS)
def test_whatever_failed_once_is_read_or_refused(seeds: dict[str, Seed], tmp_path: Path, what: str):
    name, damage = REGRESSIONS[what]
    folder = fuzz_run.copy_for_case(seeds[name], tmp_path / "case")
    for path in folder.rglob("*"):  # links to the seed's files
        if path.is_file():
            data = path.read_bytes()
            path.unlink()
            path.write_bytes(data)
    damage(folder)
    kind, text = judge(seeds[name], folder, 0.0)
    assert kind in ("read", "refused"), text


# ---------------------------------------------------------------------- failures of the workers' cases


def hog(_: Path, chance: float) -> None:
    np.ones((1 << 33, 2))


def hang(_: Path, chance: float) -> None:
    time.sleep(60)


def crash(_: Path, chance: float) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def traceback_of(_: Path, chance: float) -> None:
    raise KeyError("vertices")


def two_lines(_: Path, chance: float) -> None:
    raise InputError("")


def warn(_: Path, chance: float) -> None:
    warnings.warn("overflow", RuntimeWarning, stacklevel=1)


FAILURES = {
    hog: "MemoryError", hang: "no result within 0.5 s", crash: "status -9", traceback_of: "KeyError", two_lines: "unclear",
    warn: "overflow",
}  # fmt: skip


@pytest.mark.parametrize("use", FAILURES, ids=lambda use: use.__name__)
def test_every_kind_of_failure_is_noticed_and_the_other_cases_go_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, use: Callable[[Path, float], None]
):
    monkeypatch.setattr(fuzz_run, "SECONDS", 0.5)
    (tmp_path / "seed").mkdir()
    (tmp_path / "seed" / "a.txt").write_text("1 2 3")
    outcomes: list[Outcome] = []

    def use_or_not(folder: Path, chance: float) -> None:
        if chance < 0.5:
            use(folder, chance)

    run_cases([Seed("seed", tmp_path / "seed", ("a.txt",), use_or_not)], range(4), 2, outcomes.append)
    assert sorted(outcome.number for outcome in outcomes) == list(range(4))
    failed = [outcome for outcome in outcomes if outcome.kind == "failed"]
    assert 0 < len(failed) < 4
    assert all(FAILURES[use] in outcome.text for outcome in failed)
