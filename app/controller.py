"""What a debugger does: step, run, pause, go back. One thread owns the session; everybody else posts commands.

Nothing in here knows of a browser.
"""

import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum, IntEnum
from pathlib import Path
from typing import Any

import numpy as np

from app.breakpoints import Breakpoint, Breakpoints
from app.outcome import step_outcome
from fairing.errors import InputError
from fairing.options import FairingOptions
from fairing.scene import Scene
from fairing.session import Session
from fairing.trace import Position, StepRecord, Trace

PUBLISH_EVERY = 0.08  # s: at most 12.5 states a second while something runs
LOG_LINES = 50
SLOW_STEP = 0.15  # s: longer than this, a step says that it is at work


class Extent(IntEnum):
    """How far a step goes. The value is the number of leading fields of `Position` that stay the same within it."""

    LEVEL = 1
    SWEEP = 2
    UNIT = 3
    ITERATION = 4


class Activity(Enum):
    """What the engine is doing."""

    PAUSED = "paused"
    STEPPING = "stepping"
    RUNNING = "running"


@dataclass(frozen=True)
class Forward:
    """On to the end of the present iteration, unit, sweep or level."""

    extent: Extent


@dataclass(frozen=True)
class Back:
    """To the beginning of the iteration, unit, sweep or level that the last step belongs to."""

    extent: Extent


@dataclass(frozen=True)
class Run:
    """On until somebody pauses or the schedule is worked off."""


@dataclass(frozen=True)
class RunBack:
    """Back through the record to the last step that a breakpoint holds for, else to the start."""


@dataclass(frozen=True)
class Pause:
    """Stop after the step in hand."""


@dataclass(frozen=True)
class JumpTo:
    """To a recorded moment; -1 is the last one."""

    moment: int


@dataclass(frozen=True)
class Restart:
    """To the start, forgetting the record; with other options if given."""

    options: FairingOptions | None = None


@dataclass(frozen=True)
class Branch:
    """Forget what was recorded after the present moment and go on from here with other options."""

    options: FairingOptions


@dataclass(frozen=True)
class Ask:
    """Look something up in the session, on its own thread. Changes nothing; a newer question of the same asker
    replaces it.

    Attributes:
        asker: who wants to know.
        question: reads the session; what it raises is its answer, too.
        answer: told the result on the engine's thread, so it only keeps it.
    """

    asker: object
    question: Callable[[Session], Any]
    answer: Callable[[Any], None]


Command = Forward | Back | Run | RunBack | Pause | JumpTo | Restart | Branch | Ask


@dataclass(frozen=True, eq=False)
class RunState:
    """What there is to show, consistent in itself and never changed afterwards.

    Attributes:
        serial: grows with every state.
        run_id: changes when the record is replaced (restart, branch).
        trace: the record. It may grow; what belongs to this state are its first `length` steps.
        moment: where the run stands, 0 to `length`.
        length: recorded steps.
        vertices: (n, 3) float, positions at `moment`, world units.
        position: where the next step belongs.
        options: of this run.
        activity: what the engine is doing.
        finished: whether the schedule is worked off at `moment`.
        reason: why it stopped, one line.
        problem: what went wrong with the last command, else empty.
        progress: fraction of the schedule, 0 to 1.
        step_seconds: computing time of a step, mean over the last ones; 0 before the first.
        breakpoints: what stops a run.
        log: what breakpoints that only report had to say, the newest last.
    """

    serial: int
    run_id: int
    trace: Trace
    moment: int
    length: int
    vertices: np.ndarray
    position: Position
    options: FairingOptions
    activity: Activity
    finished: bool
    reason: str
    problem: str
    progress: float
    step_seconds: float
    breakpoints: tuple[Breakpoint, ...]
    log: tuple[str, ...]

    @property
    def record(self) -> StepRecord | None:
        """The step that led here; None at the start."""
        return self.trace.steps[self.moment - 1] if self.moment else None


Listener = Callable[[RunState], None]


class Controller:
    """Drives a session on a thread of its own and tells listeners about it on another.

    Listeners that are slow miss states, never the last one. Commands that repeat one already waiting are dropped, so
    that a key held down leaves no queue; a command posted during a run ends the run first.

    Args:
        session: the run; nobody else may touch it from now on.
        save_to: keep the record in this file.
    """

    def __init__(self, session: Session, save_to: Path | None = None) -> None:
        self.scene: Scene = session.scene
        self._session = session
        self._save_to = save_to
        if save_to is not None:
            session.trace.attach(save_to)
        self._commands: deque[Command] = deque()
        self._changed = threading.Condition()
        self._interrupt = threading.Event()
        self._closing = False
        self._listeners: list[Listener] = []
        self._run_id = 0
        self._activity = Activity.PAUSED
        self._reason = session.stop_reason if session.finished else "ready"
        self._problem = ""
        self._step_seconds: deque[float] = deque(maxlen=8)
        self._breakpoints = Breakpoints()
        self._log: deque[str] = deque(maxlen=LOG_LINES)
        self._published = 0.0
        self._serial = 0
        self._untold = False
        self._state = self._snapshot()
        self._worker = threading.Thread(target=self._work, name="engine", daemon=True)
        self._teller = threading.Thread(target=self._tell, name="publisher", daemon=True)
        self._worker.start()
        self._teller.start()

    # ------------------------------------------------------------------ for everybody

    @property
    def state(self) -> RunState:
        """The newest state."""
        return self._state

    def post(self, command: Command) -> None:
        """Ask for something; returns at once."""
        with self._changed:
            if isinstance(command, Pause):
                self._commands = deque(c for c in self._commands if isinstance(c, Ask))
            elif isinstance(command, Ask):
                self._commands = deque(
                    c for c in self._commands if not (isinstance(c, Ask) and c.asker is command.asker)
                )
            elif isinstance(command, JumpTo):
                self._commands = deque(c for c in self._commands if not isinstance(c, JumpTo))
            if command not in self._commands and not (isinstance(command, Run) and self._activity is Activity.RUNNING):
                self._commands.append(command)
                is_busy = self._activity is Activity.RUNNING and not isinstance(command, Ask)
                if is_busy or isinstance(command, Pause | JumpTo):
                    self._interrupt.set()
            self._changed.notify_all()

    def subscribe(self, listener: Listener) -> Callable[[], None]:
        """Call `listener` with every state from now on, beginning with the present one. Returns how to end that."""
        with self._changed:
            self._listeners.append(listener)
        self.republish()

        def unsubscribe() -> None:
            with self._changed:
                if listener in self._listeners:
                    self._listeners.remove(listener)

        return unsubscribe

    def republish(self) -> None:
        """Show the present state again, because somebody looks at it in another way now."""
        with self._changed:
            self._untold = True
            self._changed.notify_all()

    def edit_breakpoints(self, edit: Callable[[Breakpoints], Breakpoints]) -> None:
        """Replace the breakpoints by what `edit` makes of them; what it raises goes to the caller."""
        with self._changed:
            self._breakpoints = edit(self._breakpoints)
            self._serial += 1
            self._state = replace(self._state, serial=self._serial, breakpoints=self._breakpoints.items)
        self.republish()

    def wait_until_idle(self, timeout: float = 60.0) -> RunState:
        """The state once all commands are done. Raises TimeoutError."""
        with self._changed:
            idle = self._changed.wait_for(
                lambda: not self._commands and self._activity is Activity.PAUSED, timeout=timeout
            )
        if not idle:
            raise TimeoutError(f"the engine was still busy after {timeout:g} s")
        return self._state

    def close(self) -> None:
        """Stop after the step in hand and close the record's file."""
        with self._changed:
            self._closing = True
            self._commands.clear()
            self._interrupt.set()
            self._changed.notify_all()
        self._worker.join(timeout=30)
        self._teller.join(timeout=5)
        self._session.trace.detach()

    # ------------------------------------------------------------------ the thread that owns the session

    def _work(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._commands or self._closing)
                if self._closing:
                    return
                command = self._commands.popleft()
                if not isinstance(command, Ask):
                    self._interrupt.clear()
                    self._activity = Activity.RUNNING if isinstance(command, Run) else Activity.STEPPING
                    self._problem = ""
            if isinstance(command, Ask):
                self._answer(command)
                continue
            try:
                if isinstance(command, Run) or self._mean_step_seconds() > SLOW_STEP:
                    self._publish()
                self._reason = self._execute(command)
            except InputError as error:
                self._problem = str(error)
            except Exception as error:  # whatever a step throws must not end the debugger
                logging.getLogger(__name__).exception("the engine failed")
                self._problem = f"{type(error).__name__}: {error}"
            if self._problem:
                self._reason = f"stopped by a problem: {self._problem}"
            with self._changed:
                self._activity = Activity.PAUSED
                self._publish()

    def _answer(self, ask: Ask) -> None:
        try:
            answer = ask.question(self._session)
        except Exception as error:
            answer = error
        try:
            ask.answer(answer)
        except Exception:  # the asker's trouble is not the engine's
            logging.getLogger(__name__).exception("an answer could not be taken")
        self.republish()

    def _execute(self, command: Forward | Back | Run | RunBack | Pause | JumpTo | Restart | Branch) -> str:
        """Do it; returns why it stopped."""
        session = self._session
        match command:
            case Forward(extent):
                return self._advance(extent)
            case Run():
                return self._advance(None)
            case RunBack():
                return self._run_back()
            case Back(extent):
                if session.moment == 0:
                    return "at the start"
                session.go_to(boundary_before(session.trace.steps, session.moment, extent))
                return f"went back one {extent.name.lower()}"
            case JumpTo(moment):
                last = len(session.trace)
                session.go_to(last if moment < 0 else min(moment, last))
                return f"jumped to moment {session.moment}"
            case Restart(options):
                session.go_to(0)
                self._replace(session.branch(options))
                return "restarted: the record is empty"
            case Branch(options):
                self._replace(session.branch(options))
                return f"goes on from moment {session.moment} with other options"
            case Pause():
                return self._reason

    def _advance(self, extent: Extent | None) -> str:
        session = self._session
        if session.finished:
            return session.stop_reason
        began = session.position
        while not session.finished:
            is_new = session.moment == len(session.trace)
            started = time.perf_counter()
            session.step()
            if is_new:
                self._step_seconds.append(time.perf_counter() - started)
            stop = "" if extent is Extent.ITERATION else self._ask_breakpoints()
            if stop:
                return stop
            if extent is not None and session.position[:extent] != began[:extent]:
                break
            if self._interrupt.is_set():
                return "paused"
            if time.monotonic() - self._published > PUBLISH_EVERY:
                self._publish()
        if session.finished:
            return session.stop_reason
        return step_outcome(session.trace.steps[session.moment - 1])

    def _ask_breakpoints(self) -> str:
        """Why to stop after the step just made; empty: go on."""
        moment = self._session.moment
        with self._changed:
            self._breakpoints, hit = self._breakpoints.asked(self._session.trace.steps[moment - 1], moment)
        for item in hit:
            if item.logs:
                self._log.append(f"moment {moment}: {item.condition.text}")
        stops = [item.condition.text for item in hit if not item.logs]
        return f"breakpoint: {', '.join(stops)}" if stops else ""

    def _run_back(self) -> str:
        session = self._session
        for moment in range(session.moment - 1, 0, -1):
            session.go_to(moment)
            if stop := self._ask_breakpoints():
                return stop
            if self._interrupt.is_set():
                return "paused"
        session.go_to(0)
        return "at the start"

    def _replace(self, session: Session) -> None:
        self._session.trace.detach()
        if self._save_to is not None:
            session.trace.attach(self._save_to)
        self._session = session
        self._run_id += 1

    # ------------------------------------------------------------------ telling about it

    def _mean_step_seconds(self) -> float:
        return sum(self._step_seconds) / len(self._step_seconds) if self._step_seconds else 0.0

    def _snapshot(self) -> RunState:
        session = self._session
        self._serial += 1
        return RunState(
            serial=self._serial,
            run_id=self._run_id,
            trace=session.trace,
            moment=session.moment,
            length=len(session.trace),
            vertices=session.vertices,
            position=session.position,
            options=session.options,
            activity=self._activity,
            finished=session.finished,
            reason=self._reason,
            problem=self._problem,
            progress=session.progress,
            step_seconds=self._mean_step_seconds(),
            breakpoints=self._breakpoints.items,
            log=tuple(self._log),
        )

    def _publish(self) -> None:
        with self._changed:
            self._state = self._snapshot()
            self._untold = True
            self._published = time.monotonic()
            self._changed.notify_all()

    def _tell(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._untold or self._closing)
                if self._closing:
                    return
                state, listeners = self._state, list(self._listeners)
                self._untold = False
            for listener in listeners:
                try:
                    listener(state)
                except Exception:  # one page's trouble is not another's
                    logging.getLogger(__name__).exception("a listener failed")


def boundary_before(steps: list[StepRecord], moment: int, extent: Extent) -> int:
    """The moment at which the iteration, unit, sweep or level of the step before `moment` began."""
    if moment <= 0:
        return 0
    group = steps[moment - 1].position[:extent]
    began = moment - 1
    while began > 0 and steps[began - 1].position[:extent] == group:
        began -= 1
    return began
