"""Monkey test of the controller: random commands at random times; every published state is checked.

`python -m tests.monkey --commands 20000 --scene cube` prints figures; on a failure, the seed and the shortest tail of the
commands that fails as well. Commands and pauses between them depend on the seed alone; which of them meet, on the machine.
"""

import argparse
import gc
import random
import sys
import threading
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from app.debugger import commands as c
from app.debugger.controller import Controller
from app.debugger.quantities import parse_step_condition
from app.debugger.run_state import Activity, RunState
from fairing.errors import Cancelled, InputError
from fairing.options import FairingOptions
from fairing.run.session import Session
from fairing.scene import Scene
from tests.small_scene import corner_scene, small_options

REST_LIMIT = 1.0  # s from Pause to rest, of this process's computing time or of the clock, whichever is less
STUCK_LIMIT = 60.0  # s
BURST = 12  # commands between two checks at rest, at most
WAITS = (0.0, 0.0, 0.0, 0.002, 0.01, 0.05)  # s after a command, on the corner
SLOWER = {"corner": 1.0, "cube": 4.0, "facade": 12.0}  # factors for the waits, so that steps come to their end
CONDITIONS = (
    "rejected > 0",
    "moment == 7",
    "about(0)",
    "energy / 0 > 1",
    "moved(3) > 0.01",
    "level == 2 and sweep == 1",
)
LET_END = 40  # commands between two steps that are let end
CHUNK = 500  # commands given to one controller
BEGUN = 5  # steps of the first run
MAX_RUNS = 8  # runs kept before most are deleted again: race and branch would fill the list, and memory

Act = Callable[[Controller], None]


@dataclass
class Outcome:
    """What a monkey did.

    Attributes:
        names: how often each kind of command was given.
        refusals: commands refused with an error in one line.
        states: published states that were checked.
        rests: s from Pause to rest.
        steps: recorded steps that published states showed for the first time.
    """

    names: dict[str, int] = field(default_factory=dict)
    refusals: int = 0
    states: int = 0
    rests: list[float] = field(default_factory=list)
    steps: int = 0


class MonkeyError(AssertionError):
    """A rule was broken."""


class Monkey:
    """Gives commands to a controller.

    Every controller begins with a run that is planned and has a few steps: on a large scene commands may come faster than
    steps end.

    Args:
        session: the first run, at its start.
        variants: options for branches, restarts and races.
        slower: factor for the waits between commands.
    """

    def __init__(self, session: Session, variants: list[FairingOptions], slower: float = 1.0) -> None:
        self._begun, self._variants, self._slower = session, variants, slower
        for _ in range(BEGUN):
            self._begun.step()

    def warm_up(self) -> None:
        """Compile the engine, which cannot be cancelled."""
        for options in self._variants:
            branch = self._begun.branch(options)
            for _ in range(3):
                branch.step()

    def play(self, seed: int, numbers: Iterable[int], outcome: Outcome) -> None:
        """Give the commands with these numbers of a seed.

        Raises:
            MonkeyError: a rule was broken.
        """
        controller = Controller(self._begun.branch())
        checker = _Checker(outcome)
        controller.subscribe(checker)
        threads = (controller._engine._thread, controller._publisher.worker._thread)
        try:
            for count, number in enumerate(numbers, 1):
                rng = random.Random(f"{seed}/{number}")
                name, act = self._command(rng, controller.state)
                outcome.names[name] = outcome.names.get(name, 0) + 1
                try:
                    act(controller)
                except InputError:
                    outcome.refusals += 1
                time.sleep(self._slower * rng.choice(WAITS))
                if rng.random() < 1 / BURST:
                    self._check_rest(controller, outcome)
                if count % LET_END == 0:
                    _let_end(controller)
                if count % 50 == 0:
                    self._tidy(controller)
            self._check_rest(controller, outcome)
            checker.wait_for(controller.state)
            if threads != (controller._engine._thread, controller._publisher.worker._thread):
                raise MonkeyError(f"a thread was replaced: {controller.state.incident}")
        finally:
            controller.close()

    def _check_rest(self, controller: Controller, outcome: Outcome) -> None:
        """Pause, and check the state at rest."""
        clock, used = time.monotonic(), time.process_time()
        controller.post(c.Pause())
        state, stack = None, ""
        while state is None:
            try:
                state = controller.wait_until_idle(REST_LIMIT / 4)
            except TimeoutError:
                stack = controller._engine.stack()
                if time.monotonic() - clock > STUCK_LIMIT:
                    raise MonkeyError(f"not at rest {STUCK_LIMIT:g} s after Pause\n{stack}") from None
        rest = min(time.monotonic() - clock, time.process_time() - used)
        outcome.rests.append(rest)
        if rest > REST_LIMIT:
            raise MonkeyError(f"at rest {rest:.2f} s after Pause, expected {REST_LIMIT:g}; shortly before:\n{stack}")
        check(state)
        session = controller._runs.session
        if (state.moment, state.length, state.trace) != (session.moment, len(session.trace), session.trace):
            raise MonkeyError("the state at rest is not that of the session")
        if state.activity is not Activity.PAUSED:
            raise MonkeyError(f"at rest, but {state.activity}")

    def _tidy(self, controller: Controller) -> None:
        """Delete runs: memory would fill, and a list that is full refuses most commands."""
        runs = controller.state.runs
        for run in runs[:-2] if len(runs) > MAX_RUNS else ():
            controller.post(c.DeleteRun(run.run_id))

    def _command(self, rng: random.Random, state: RunState) -> tuple[str, Act]:
        name, make = rng.choice(_COMMANDS)
        made = make(rng, state, self._variants)
        if callable(made):
            return name, made
        return name, lambda controller: controller.post(made)


class _Checker:
    """A listener that checks every state; the first broken rule is raised at the end."""

    def __init__(self, outcome: Outcome) -> None:
        self._outcome, self._serial, self._error = outcome, 0, ""
        self._trace, self._length = None, 0

    def __call__(self, state: RunState) -> None:
        try:
            if state.serial < self._serial:
                raise MonkeyError(f"state {state.serial} after {self._serial}")
            self._serial = state.serial
            if state.trace is self._trace:
                self._outcome.steps += max(0, state.length - self._length)
            self._trace, self._length = state.trace, state.length
            check(state)
        except MonkeyError as error:
            self._error = self._error or str(error)
        self._outcome.states += 1

    def wait_for(self, state: RunState) -> None:
        """Wait for the delivery of a state, then raise what was wrong."""
        deadline = time.monotonic() + STUCK_LIMIT
        while self._serial < state.serial:
            if time.monotonic() > deadline:
                raise MonkeyError(f"state {state.serial} was not delivered")
            time.sleep(0.002)
        if self._error:
            raise MonkeyError(self._error)


def check(state: RunState) -> None:
    """Whether a state is consistent with the record.

    Raises:
        MonkeyError: it is not.
    """
    rules = {
        "the moment is within the record": 0 <= state.moment <= state.length <= len(state.trace),
        "the current run is listed": state.run_id in [run.run_id for run in state.runs],
        "the vertices are those of the moment": np.array_equal(state.vertices, state.trace.vertices_at(state.moment)),
        "the vertices are finite": bool(np.isfinite(state.vertices).all()),
        "the position is the recorded one": state.moment == 0
        or state.position == state.trace.steps[state.moment - 1].next_position,
        "finished means beyond the last level": state.finished == (state.position.level >= state.options.n_levels),
        "progress is a fraction": 0 <= state.progress <= 1,
        "there was no incident": state.incident is None,
        "the list of runs has the present moment": any(
            (run.run_id, run.trace, run.length, run.moment) == (state.run_id, state.trace, state.length, state.moment)
            for run in state.runs
        ),
    }
    broken = [rule for rule, holds in rules.items() if not holds]
    if broken:
        raise MonkeyError(f"broken: {'; '.join(broken)} (state {state.serial}, {state.reason}, {state.incident})")


def _let_end(controller: Controller) -> None:
    """Make a step and wait until it is done: on a busy machine the other commands come faster than steps end.

    Raises:
        MonkeyError: it is not done in time.
    """
    controller.post(c.Pause())
    controller.post(c.JumpTo(-1))
    controller.post(c.Forward(c.Extent.BLOCK))
    try:
        controller.wait_until_idle(STUCK_LIMIT * 10)
    except TimeoutError:
        raise MonkeyError(f"a step is not done after {10 * STUCK_LIMIT:g} s\n{controller._engine.stack()}") from None


# ---------------------------------------------------------------------- the commands


def _extent(rng: random.Random) -> c.Extent:
    return rng.choice([*c.Extent, c.Extent.ITERATION, c.Extent.BLOCK])


def _vertices(rng: random.Random, state: RunState) -> tuple[int, ...]:
    """Mostly a few, sometimes all or none, sometimes out of range."""
    n = len(state.vertices)
    kind = rng.random()
    if kind < 0.05:
        return ()
    if kind < 0.1:
        return (rng.choice([-1, n, 10**9]),)
    if kind < 0.15:
        return tuple(range(n))
    return tuple(rng.sample(range(n), rng.randint(1, min(3, n))))


def _place(rng: random.Random, state: RunState, _: list[FairingOptions]) -> c.Command:
    vertices = _vertices(rng, state)
    size = float(np.ptp(state.vertices)) * rng.choice([1e-3, 1e-2, 0.1, 10.0, 1e30, float("nan"), float("inf")])
    known = [vertex % len(state.vertices) for vertex in vertices]
    moved = [state.vertices[vertex] + size * rng.uniform(-1, 1) for vertex in known]
    positions = tuple((float(x), float(y), float(z)) for x, y, z in moved)
    return c.Place(vertices, positions[: rng.choice([None, None, None, 1])])


def _drag(rng: random.Random, state: RunState, _: list[FairingOptions]) -> Act:
    """A pointer that drags a vertex: pause, then several places in quick succession."""
    vertex = rng.randrange(len(state.vertices))
    x, y, z = state.vertices[vertex].tolist()
    size = 0.01 * float(np.ptp(state.vertices))

    def act(controller: Controller) -> None:
        controller.post(c.Pause())
        for n in range(4):
            controller.post(c.Place((vertex,), ((x + n * size, y, z),)))
            time.sleep(0.002)

    return act


def _scrub(rng: random.Random, state: RunState, _: list[FairingOptions]) -> Act:
    moments = [rng.randint(-1, state.length + 2) for _ in range(8)]

    def act(controller: Controller) -> None:
        for moment in moments:
            controller.post(c.JumpTo(moment))
            time.sleep(0.001)

    return act


def _options(rng: random.Random, variants: list[FairingOptions]) -> FairingOptions:
    """One of the variants, or options that are out of range."""
    options = rng.choice(variants)
    if rng.random() < 0.2:
        broken = [
            options.with_levels(size=-3),
            options.with_levels(dimensions=10**6),
            replace(options, step=replace(options.step, max_step=float("nan"))),
            replace(options, locked_vertices=(10**9,)),
        ]
        return rng.choice(broken)
    return options


def _query(rng: random.Random, state: RunState, _: list[FairingOptions]) -> c.Command:
    seconds, kind = rng.choice([0.0, 0.0, 0.01, 0.05]), rng.random()

    def compute(session: Session) -> float:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if session.cancel_requested():
                raise Cancelled
            time.sleep(0.001)
        if kind < 0.2:
            raise ValueError("a query failed")
        return session.progress if kind < 0.4 else float(session.sweep_state().scale) if kind < 0.5 else 0.0

    return c.Query(rng.choice("abc"), compute, lambda _: None)


def _breakpoint(rng: random.Random, state: RunState, _: list[FairingOptions]) -> Act:
    text, kind = rng.choice([*CONDITIONS, "no such ( name"]), rng.random()

    def act(controller: Controller) -> None:
        items = controller.state.breakpoints
        if kind < 0.5 or not items:
            controller.edit_breakpoints(lambda breakpoints: breakpoints.added(text))
        elif kind < 0.6:
            controller.edit_breakpoints(
                lambda breakpoints: breakpoints.changed(items[0].number, lambda item: replace(item, logs=not item.logs))
            )
        else:
            controller.edit_breakpoints(lambda breakpoints: breakpoints.removed(items[-1].number))

    return act


def _bookmark(rng: random.Random, state: RunState, _: list[FairingOptions]) -> Act:
    def act(controller: Controller) -> None:
        items = controller.state.bookmarks
        if len(items) > 5:
            controller.edit_bookmarks(lambda bookmarks: bookmarks.removed(items[0].number))
        else:
            controller.edit_bookmarks(lambda bookmarks: bookmarks.added(state.run_id, state.moment, "start", "a note"))

    return act


def _run_id(rng: random.Random, state: RunState) -> int:
    return rng.choice([*(run.run_id for run in state.runs), 0, 10**6])


Make = Callable[[random.Random, RunState, list[FairingOptions]], "c.Command | Act"]
_COMMANDS: list[tuple[str, Make]] = [
    ("forward", lambda rng, state, variants: c.Forward(_extent(rng))),
    ("forward", lambda rng, state, variants: c.Forward(_extent(rng))),
    ("back", lambda rng, state, variants: c.Back(_extent(rng))),
    ("to beginning", lambda rng, state, variants: c.ToBeginning(rng.choice(list(c.Extent)))),
    ("run", lambda rng, state, variants: c.Run()),
    ("run", lambda rng, state, variants: c.Run()),
    ("run until", lambda rng, state, variants: c.Run(parse_step_condition(rng.choice(CONDITIONS)))),
    ("run back", lambda rng, state, variants: c.RunBack()),
    ("pause", lambda rng, state, variants: c.Pause()),
    ("jump", lambda rng, state, variants: c.JumpTo(rng.choice([-1, 0, 10**12, rng.randint(0, 1 + state.length)]))),
    ("scrub", _scrub),
    ("play", lambda rng, state, variants: c.Play(rng.choice([0.0, -1.0, 5.0, 200.0, 1e9, float("nan"), float("inf")]))),
    ("restart", lambda rng, state, variants: c.Restart(rng.choice([None, _options(rng, variants)]))),
    ("branch", lambda rng, state, variants: c.Branch(_options(rng, variants))),
    ("place", _place),
    ("drag", _drag),
    ("reset", lambda rng, state, variants: c.Reset(_vertices(rng, state))),
    ("lock", lambda rng, state, variants: c.Lock(_vertices(rng, state), rng.random() < 0.5)),
    ("unlock", lambda rng, state, variants: c.Lock(tuple(range(len(state.vertices))), locked=False)),
    ("switch", lambda rng, state, variants: c.SwitchTo(_run_id(rng, state), rng.choice([None, 0, -1, 3, 10**9]))),
    ("delete", lambda rng, state, variants: c.DeleteRun(_run_id(rng, state))),
    ("race", lambda rng, state, variants: c.Race(_options(rng, variants), _options(rng, variants))),
    ("query", _query),
    ("query", _query),
    ("breakpoint", _breakpoint),
    ("bookmark", _bookmark),
    ("republish", lambda rng, state, variants: lambda controller: controller.republish()),
]


# ---------------------------------------------------------------------- scenes, shrinking, the command line


def small_variants() -> list[FairingOptions]:
    """Options for the small corner: every order, both solvers, with and without preparations and priors."""
    options = small_options()
    return [
        options,
        small_options(schedule={"order": "joint", "max_sweeps": [2]}),
        small_options(schedule={"order": "sequential", "max_iterations": [2]}),
        small_options("paper"),
        small_options(step={"smoothing": [0.1, 0.03, 0.01]}),
        replace(options, lock_boundary=True),
    ]


def monkey_on(name: str) -> Monkey:
    """A monkey on "corner", the small scene of the tests, or on a demo scene."""
    if name == "corner":
        variants = small_variants()
        return Monkey(Session(corner_scene(), variants[0]), variants)
    from demo_scenes import load_demo
    from fairing.options import PRESETS

    scene: Scene = load_demo(name)
    variants = list(PRESETS.values())
    return Monkey(Session(scene, variants[0]), variants, SLOWER.get(name, 1.0))


def shrunk(monkey: Monkey, seed: int, begin: int, end: int, tries: int = 3) -> range:
    """The shortest tail of the commands `begin` to `end`, of lengths 1, 2, 4 ..., that fails on a new controller, too."""
    length = 1
    while length < end - begin:
        for _ in range(tries):
            try:
                monkey.play(seed, range(end - length, end), Outcome())
            except MonkeyError:
                return range(end - length, end)
        length *= 2
    return range(begin, end)


def play(
    monkey: Monkey, seed: int, first: int, last: int, on_chunk: Callable[[Outcome], None] = lambda _: None
) -> Outcome:
    """Give the commands `first` to `last`, with a new controller for every `CHUNK`; then `on_chunk` is called.

    Raises:
        MonkeyError: a rule was broken; the message has the seed and the shrunk tail.
    """
    outcome = Outcome()
    monkey.warm_up()
    for begin in range(first, last, CHUNK):
        end = min(begin + CHUNK, last)
        try:
            monkey.play(seed, range(begin, end), outcome)
        except MonkeyError as error:
            tail = shrunk(monkey, seed, begin, end)
            again = f"python -m tests.monkey --seed {seed} --first {tail.start} --commands {len(tail)}"
            raise MonkeyError(f"{error}\nseed {seed}; shortest tail that fails: {again}") from error
        on_chunk(outcome)
    return outcome


def threads_left() -> int:
    """Threads beside the main one, after a garbage collection, which ends the pools of deleted sessions.

    The pool of the first run is kept.
    """
    gc.collect()
    time.sleep(0.5)
    return threading.active_count() - 1


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--commands", type=int, default=20000)
    parser.add_argument("--scene", default="corner", help="corner, cube, facade or another demo scene")
    parser.add_argument("--seed", type=int, default=int(time.time()))
    parser.add_argument("--first", type=int, default=0, help="number of the first command")
    arguments = parser.parse_args()
    print(f"seed {arguments.seed}", flush=True)
    began = time.monotonic()
    last = arguments.first + arguments.commands

    def show(outcome: Outcome) -> None:
        rests = np.array(outcome.rests)
        print(
            f"{sum(outcome.names.values())} commands in {time.monotonic() - began:.0f} s, {outcome.states} states checked, "
            f"{outcome.steps} steps recorded, {len(rests)} rests: median {1e3 * np.median(rests):.0f}, "
            f"longest {1e3 * rests.max():.0f} ms; threads left: {threads_left()}",
            flush=True,
        )

    outcome = play(monkey_on(arguments.scene), arguments.seed, arguments.first, last, show)
    print(", ".join(f"{name} {count}" for name, count in sorted(outcome.names.items())))


if __name__ == "__main__":
    try:
        main()
    except MonkeyError as broken:
        print(broken)
        sys.exit(1)
