"""Soak test: several pages are used at random for a long time. `python -m tests.soak --minutes 120`

Pages open, reload, step, run, scrub, branch, play and select, on the demo cube, in headless Chromium. Afterwards, or after
Ctrl-C, a table shows the server's memory, threads and file descriptors over time. The exit code is 0 if, after the first
minutes, memory grew by less than 5 % an hour, threads and descriptors did not grow, and no page logged an error.
"""

import argparse
import gc
import random
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from playwright.sync_api import Browser

from app.debugger.commands import DeleteRun, Pause
from app.page.server import App, start
from demo_scenes import load_demo
from fairing.options import PRESETS
from fairing.run.session import Session
from tests.browser.driver import Visitor, chromium
from tests.waiting import wait_for

PAGES = 3
WARM_UP = 0.25  # of the time, at most WARM_UP_MINUTES: caches fill
WARM_UP_MINUTES = 20.0
SAMPLE_SECONDS = 10.0
MOST_RUNS = 4  # kept: every branch is a run, and users delete them, too
MOST_STEPS = 400  # a longer record starts over, because a record grows by design
MAX_GROWTH = 5.0  # % an hour
MAX_EXTRA = 3  # threads or descriptors: pools start theirs when they are needed


@dataclass(frozen=True)
class Sample:
    """Attributes:
    minutes: since the start.
    memory: resident, MB.
    """

    minutes: float
    memory: float
    threads: int
    descriptors: int


def sample(began: float) -> Sample:
    """What the server's process uses now."""
    gc.collect()
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return Sample(
        (time.monotonic() - began) / 60,
        pages * 4096 / 1e6,
        threading.active_count(),
        len(list(Path("/proc/self/fd").iterdir())),
    )


class Users:
    """Pages that are used at random."""

    def __init__(self, browser: Browser, app: App, seed: int) -> None:
        self._browser, self._app, self._random = browser, app, random.Random(seed)
        self.visitors = [Visitor(browser, app) for _ in range(PAGES)]
        self.troubles: list[str] = []
        self.actions: dict[str, int] = {}

    def act(self) -> None:
        """One action on one page."""
        k = self._random.randrange(PAGES)
        actions: list[Callable[[Visitor], None]] = [
            *(self._step,) * 6, *(self._scrub,) * 4, *(self._select,) * 3, self._run_and_pause, self._play, self._branch,
            self._look_through, self._change_theme, self._change_surface, self._reload, self._reopen,
        ]  # fmt: skip
        action = self._random.choice(actions)
        name = action.__name__.strip("_")
        self.actions[name] = self.actions.get(name, 0) + 1
        if action == self._reopen:
            self.troubles += self.visitors[k].troubles
            self.visitors[k].page.close()
            self.visitors[k] = Visitor(self._browser, self._app)
        else:
            action(self.visitors[k])
        self._tidy()

    def all_troubles(self) -> list[str]:
        return self.troubles + [trouble for visitor in self.visitors for trouble in visitor.troubles]

    def _key(self, visitor: Visitor, key: str) -> None:
        visitor.page.keyboard.press(key)
        time.sleep(self._random.uniform(0, 0.3))

    def _step(self, visitor: Visitor) -> None:
        self._key(visitor, self._random.choice("inu,"))

    def _run_and_pause(self, visitor: Visitor) -> None:
        self._key(visitor, "g")
        time.sleep(self._random.uniform(0.5, 2))
        self._key(visitor, "p")

    def _play(self, visitor: Visitor) -> None:
        self._key(visitor, "h")
        self._key(visitor, "t")
        time.sleep(self._random.uniform(0.5, 2))
        self._key(visitor, "p")

    def _scrub(self, visitor: Visitor) -> None:
        strip = visitor.page.get_by_role("img", name="What happened")
        if strip.count():
            box = visitor.box_of(strip.first)
            visitor.page.mouse.click(box["x"] + self._random.random() * box["width"], box["y"] + box["height"] / 2)

    def _select(self, visitor: Visitor) -> None:
        entry = visitor.input_of("Vertices")
        if entry.count() and entry.first.is_visible():
            entry.first.fill(str(self._random.randrange(7)))
            entry.first.press("Enter")

    def _branch(self, visitor: Visitor) -> None:
        """Reset a vertex at a past moment, which forks a run."""
        self._select(visitor)
        self._key(visitor, ",")
        self._key(visitor, "z")

    def _look_through(self, visitor: Visitor) -> None:
        self._key(visitor, str(self._random.randrange(1, 6)))
        time.sleep(0.5)
        self._key(visitor, "0")

    def _change_theme(self, visitor: Visitor) -> None:
        self._key(visitor, "y")

    def _change_surface(self, visitor: Visitor) -> None:
        self._key(visitor, self._random.choice("x-"))

    def _reload(self, visitor: Visitor) -> None:
        visitor.open()

    def _reopen(self, visitor: Visitor) -> None:
        """Close the page and open another; see `act`."""

    def _tidy(self) -> None:
        controller = self._app.controller
        state = controller.state
        if len(state.runs) > MOST_RUNS:
            controller.post(Pause())
            controller.post(DeleteRun(next(run.run_id for run in state.runs if run.run_id != state.run_id)))
        if state.length > MOST_STEPS:
            controller.post(Pause())
            wait_for(lambda: not controller.state.is_moving)
            self._key(self.visitors[0], "r")


def growth(samples: list[Sample]) -> float:
    """Slope of the memory by least squares, % an hour; 0 without enough samples."""
    if len(samples) < 3:
        return 0.0
    minutes, memory = np.array([(s.minutes, s.memory) for s in samples]).T
    return float(100 * 60 * np.polyfit(minutes, memory, 1)[0] / memory[0])


def soak(minutes: float, seed: int) -> int:
    """Returns the exit code."""
    began = time.monotonic()
    samples: list[Sample] = []
    app = start(Session(load_demo("cube"), PRESETS["paper"]), port=0)
    with chromium() as browser:
        users = Users(browser, app, seed)
        try:
            while time.monotonic() < began + 60 * minutes:
                users.act()
                if not samples or time.monotonic() > began + 60 * samples[-1].minutes + SAMPLE_SECONDS:
                    samples.append(sample(began))
        except KeyboardInterrupt:
            pass
    app.stop()
    return report(samples, min(WARM_UP * minutes, WARM_UP_MINUTES), users)


def report(samples: list[Sample], warm_up: float, users: Users) -> int:
    """Print what was measured. Returns the exit code."""
    warm = [s for s in samples if s.minutes >= warm_up]
    for s in samples[:: max(1, len(samples) // 20)]:
        print(f"{s.minutes:7.1f} min  {s.memory:7.0f} MB  {s.threads:4d} threads  {s.descriptors:4d} descriptors")
    troubles, per_hour = users.all_troubles(), growth(warm)
    extra_threads, extra_descriptors = (
        max(getattr(s, name) for s in warm[-len(warm) // 4 :])
        - max(getattr(s, name) for s in warm[: len(warm) // 4 + 1])
        if warm
        else 0
        for name in ("threads", "descriptors")
    )
    print(f"actions: {', '.join(f'{name} {count}' for name, count in sorted(users.actions.items()))}")
    print(f"memory after {warm_up:.1f} min: {per_hour:+.1f} % an hour")
    print(f"threads {extra_threads:+d}, descriptors {extra_descriptors:+d}, page errors: {len(troubles)}")
    for trouble in troubles[:10]:
        print(f"  {trouble}")
    holds = per_hour < MAX_GROWTH and max(extra_threads, extra_descriptors) <= MAX_EXTRA and not troubles
    return 0 if holds else 1


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=5.0, help="how long; 120 for a release (default: 5)")
    parser.add_argument("--seed", type=int, default=0, help="of the random actions (default: 0)")
    given = parser.parse_args()
    sys.exit(soak(given.minutes, given.seed))
