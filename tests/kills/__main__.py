"""`python -m tests.kills --times 100`: end runs in all ways, print what happened, exit with 1 if a check failed."""

import argparse
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from tests.kills.run import KINDS, Reference, kill_and_resume


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.kills", description=__doc__)
    parser.add_argument("--times", type=int, default=100, help="how many runs to end (default 100)")
    parser.add_argument("--seed", type=int, default=0, help="of the random moments (default 0)")
    parser.add_argument("--kind", choices=KINDS, help="only this way to end a run")
    options = parser.parse_args()
    failed = 0
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        reference = Reference(Path(folder))
        print(f"a run of {reference.steps} steps takes {reference.seconds:.1f} s", flush=True)
        for i in range(options.times):
            kind = options.kind or KINDS[i % len(KINDS)]
            try:
                story = kill_and_resume(
                    reference, kind, np.random.default_rng([options.seed, i]), Path(folder) / f"{i}"
                )
                print(f"{i}: {story}", flush=True)
            except AssertionError as error:
                failed += 1
                print(f"{i}: {kind}: FAILED: {error}", flush=True)
    print(f"{options.times} runs ended in {time.monotonic() - began:.0f} s, {failed} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
