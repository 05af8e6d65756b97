"""`python -m tests.soak --minutes 120`: use the debugger at random, print what its process used, exit with 1 if it grew."""

import argparse
import sys
import threading
import time
from collections import Counter
from contextlib import suppress

import numpy as np

from tests.browser.driver import chromium
from tests.soak.server import Sample, Server
from tests.soak.users import Users

WARM_UP = 0.25  # of the time, at most WARM_UP_MINUTES
WARM_UP_MINUTES = 15.0
SAMPLE_SECONDS = 10.0
PRINTED_EVERY = 6  # samples
MAX_GROWTH = 5.0  # % an hour
MAX_EXTRA = 3  # threads or descriptors: timers and pages that are just being opened


def growth(samples: list[Sample], quantity: str = "memory") -> float:
    """Slope of a quantity of the samples by least squares, % an hour; 0 without enough samples."""
    if len(samples) < 3:
        return 0.0
    minutes, values = np.array([(s.minutes, getattr(s, quantity)) for s in samples]).T
    return float(100 * 60 * np.polyfit(minutes, values, 1)[0] / np.median(values))


def by_half_hour(samples: list[Sample], quantity: str = "memory") -> str:
    """Median of a quantity of the samples in every half hour."""
    n_halves = 1 + int(max((s.minutes for s in samples), default=0) / 30)
    halves = [[getattr(s, quantity) for s in samples if int(s.minutes / 30) == k] for k in range(n_halves)]
    return ", ".join(f"{np.median(half):.0f}" for half in halves if half)


def rise(values: list[int]) -> float:
    """Median of the last quarter less that of the first quarter."""
    quarter = len(values) // 4 + 1
    return float(np.median(values[-quarter:]) - np.median(values[:quarter])) if values else 0.0


def watch(server: Server, ended: threading.Event, samples: list[Sample]) -> None:
    """Append samples until the end, and print one a minute."""
    began = time.monotonic()
    while not ended.wait(SAMPLE_SECONDS):
        samples.append(server.sample((time.monotonic() - began) / 60))
        if len(samples) % PRINTED_EVERY == 1:
            show(samples[-1])


def soak(minutes: float, seed: int, pace: float) -> int:
    """Returns the exit code."""
    server = Server()
    ended, samples = threading.Event(), []
    watching = threading.Thread(target=watch, args=(server, ended, samples), daemon=True)
    watching.start()
    began = time.monotonic()
    with chromium() as browser:
        users = Users(browser, server, seed, pages=3, pace=pace)
        with suppress(KeyboardInterrupt):
            while time.monotonic() < began + 60 * minutes:
                users.act()
        ended.set()
        watching.join()
        code = report(samples, min(WARM_UP * minutes, WARM_UP_MINUTES), users)
    server.close()
    return code


def show(s: Sample) -> None:
    print(
        f"{s.minutes:7.1f} min  {s.memory:7.0f} MB, {s.allocated:5.0f} MB allocated, {s.blocks / 1000:5.0f} k blocks  "
        f"{s.threads:4d} threads  {s.descriptors:4d} descriptors",
        flush=True,
    )


def report(samples: list[Sample], warm_up: float, users: Users) -> int:
    """Print what was measured. Returns the exit code."""
    warm = [s for s in samples if s.minutes >= warm_up]
    troubles, per_hour = users.troubles, growth(warm)
    threads, descriptors = rise([s.threads for s in warm]), rise([s.descriptors for s in warm])
    print(f"actions with their effect: {listed(users.done)}")
    print(f"refused with a message: {listed(users.refused)}")
    print(f"memory after {warm_up:.1f} min: {per_hour:+.1f} % an hour")
    print(f"median memory by half hour: {by_half_hour(samples)} MB")
    print(f"of it allocated: {by_half_hour(samples, 'allocated')} MB, {growth(warm, 'allocated'):+.1f} % an hour")
    print(f"blocks of Python's by half hour: {by_half_hour(samples, 'blocks')}")
    print(f"threads {threads:+g}, descriptors {descriptors:+g}, errors and actions without effect: {len(troubles)}")
    for trouble in troubles[:10]:
        print(f"  {trouble}")
    refused = [name for name, count in users.refused.items() if count > users.done[name]]
    is_flat = per_hour < MAX_GROWTH and max(threads, descriptors) <= MAX_EXTRA
    return 0 if is_flat and not troubles and not refused else 1


def listed(counts: Counter[str]) -> str:
    return ", ".join(f"{name} {count}" for name, count in sorted(counts.items())) or "none"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m tests.soak", description=__doc__)
    parser.add_argument("--minutes", type=float, default=5.0, help="how long; 120 for a release (default 5)")
    parser.add_argument("--seed", type=int, default=0, help="of the random actions (default 0)")
    parser.add_argument("--pace", type=float, default=1.0, help="factor for the pauses between actions (default 1)")
    given = parser.parse_args()
    sys.exit(soak(given.minutes, given.seed, given.pace))
