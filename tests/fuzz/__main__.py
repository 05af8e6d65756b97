"""`python -m tests.fuzz --cases 20000`: fuzz the readers, print what failed, exit with 1 if anything did."""

import argparse
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from tests.fuzz.run import Outcome, run_cases
from tests.fuzz.seeds import make_seeds


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--cases", type=int, default=1000, help="how many (default 1000)")
    parser.add_argument("--first", type=int, default=0, help="number of the first case (default 0)")
    parser.add_argument("--workers", type=int, default=2, help="processes (default 2)")
    parser.add_argument("--keep", type=Path, help="folder for the inputs of failed cases")
    options = parser.parse_args()
    failures: list[Outcome] = []
    kinds: Counter[str] = Counter()

    def count(outcome: Outcome) -> None:
        kinds[outcome.kind] += 1
        if outcome.kind == "failed":
            failures.append(outcome)
            print(f"case {outcome.number} ({outcome.name}): {outcome.text.strip().splitlines()[-1]}", flush=True)

    began = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        numbers = range(options.first, options.first + options.cases)
        run_cases(make_seeds(Path(folder)), numbers, options.workers, count, options.keep)
    summary = ", ".join(f"{kinds[kind]} {kind}" for kind in ("read", "refused", "failed"))
    print(f"{sum(kinds.values())} cases in {time.monotonic() - began:.0f} s: {summary}")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
