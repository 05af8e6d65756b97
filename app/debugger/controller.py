"""What a debugger does: step, run, pause, go back. One thread owns the session; everybody else posts commands.

Nothing in here knows of a browser.
"""

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Collection
from dataclasses import replace
from pathlib import Path

import numpy as np

from app.debugger.bookmarks import Bookmarks, file_beside, read_bookmarks, write_bookmarks
from app.debugger.breakpoints import Breakpoints
from app.debugger.commands import (
    Back,
    Branch,
    Command,
    DeleteRun,
    Extent,
    Forward,
    JumpTo,
    Lock,
    Pause,
    Place,
    Play,
    Query,
    Race,
    Reset,
    Restart,
    Run,
    RunBack,
    SwitchTo,
    ToBeginning,
)
from app.debugger.condition import Condition
from app.debugger.manual_edits import lock_by_hand, step_by_hand
from app.debugger.quantities import Around, quantities_of
from app.debugger.run_state import Activity, RunState
from app.debugger.runs import Runs
from app.debugger.step_text import step_outcome
from fairing.errors import Cancelled, InputError
from fairing.options import FairingOptions
from fairing.run.session import Session
from fairing.scene import Scene
from fairing.trace import SchedulePosition, StepRecord

PUBLISH_EVERY = 0.06  # s: at most 16 states a second while something runs; steps between make it 10 to 15
LOG_LINES = 50
SLOW_STEP = 0.15  # s: longer than this, a step says that it is at work
MAX_PLAY_RATE = 1000.0  # moments a second

Listener = Callable[[RunState], None]


class Controller:
    """Drives a session on a thread of its own and tells listeners about it on another.

    Listeners that are slow miss states, never the last one. Commands that repeat one already waiting are dropped, so
    that a key held down leaves no queue; a command posted during a run ends the run first.

    Args:
        session: the run; nobody else may touch it from now on.
        save_to: keep the record in this file.
        recorded_in: the file the record was read from; bookmarks are read from beside it, and kept there.

    Raises:
        InputError: `save_to` cannot be written, or the bookmarks cannot be read.
    """

    def __init__(self, session: Session, save_to: Path | None = None, recorded_in: Path | None = None) -> None:
        self.scene: Scene = session.scene
        self._runs = Runs(session, save_to, recorded_in)
        self._bookmarks = Bookmarks()
        if recorded_in is not None:
            self._bookmarks = read_bookmarks(file_beside(recorded_in), len(session.trace))
        self._rival: int | None = None
        self._commands: deque[Command] = deque()
        self._changed = threading.Condition()
        self._interrupt = threading.Event()
        self._closing = False
        self._listeners: list[Listener] = []
        self._activity = Activity.PAUSED
        self._at_work_since = 0.0
        self._stopped = session.vertices  # when the run last stopped
        self._reason = session.stop_reason if session.finished else "ready"
        self._problem, self._problems = "", 0
        self._step_seconds: deque[float] = deque(maxlen=8)
        self._breakpoints = Breakpoints()
        self._log: deque[str] = deque(maxlen=LOG_LINES)
        self._published = 0.0
        self._serial = 0
        self._untold = False
        session.cancel_requested = self._interrupt.is_set
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
        """Query for something; returns at once."""
        with self._changed:
            if isinstance(command, Pause):
                self._commands = deque(c for c in self._commands if isinstance(c, Query))
            elif isinstance(command, Query):
                self._commands = deque(
                    c for c in self._commands if not (isinstance(c, Query) and c.asker is command.asker)
                )
            elif isinstance(command, JumpTo):
                self._commands = deque(c for c in self._commands if not isinstance(c, JumpTo))
            if command not in self._commands and not (isinstance(command, Run) and self._activity is Activity.RUNNING):
                self._commands.append(command)
                is_busy = self._activity in (Activity.RUNNING, Activity.PLAYING) and not isinstance(command, Query)
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

    def edit_bookmarks(self, edit: Callable[[Bookmarks], Bookmarks]) -> None:
        """Replace the bookmarks by what `edit` makes of them, and write the files of runs whose bookmarks changed.

        Raises:
            InputError: a file cannot be written; the bookmarks are changed all the same. Or what `edit` raises.
        """
        with self._changed:
            before = self._bookmarks
            self._bookmarks = edit(before)
            self._serial += 1
            self._state = replace(self._state, serial=self._serial, bookmarks=self._bookmarks.items)
            after = self._bookmarks
        self.republish()
        for run in self._state.runs:
            file = self._runs.file_of(run.run_id)
            if file is not None and before.of_run(run.run_id) != after.of_run(run.run_id):
                write_bookmarks(file_beside(file), after.of_run(run.run_id))

    def wait_until_idle(self, timeout: float = 300.0) -> RunState:
        """The state once all commands are done. Raises TimeoutError."""
        with self._changed:
            idle = self._changed.wait_for(
                lambda: not self._commands and self._activity is Activity.PAUSED, timeout=timeout
            )
        if not idle:
            raise TimeoutError(f"the engine was still busy after {timeout:g} s")
        return self._state

    def close(self) -> None:
        """Drop the step in hand and close the records' files."""
        with self._changed:
            self._closing = True
            self._commands.clear()
            self._interrupt.set()
            self._changed.notify_all()
        self._worker.join(timeout=30)
        self._teller.join(timeout=5)
        self._runs.close()

    # ------------------------------------------------------------------ the thread that owns the session

    @property
    def _session(self) -> Session:
        return self._runs.session

    def _work(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._commands or self._closing)
                if self._closing:
                    return
                command = self._commands.popleft()
                if not isinstance(command, Query):
                    self._interrupt.clear()
                    self._activity = _activity_of(command)
                    self._at_work_since = time.monotonic()
                    self._problem = ""
            if isinstance(command, Query):
                self._answer(command)
                continue
            try:
                if self._activity is not Activity.STEPPING:
                    self._publish()
                self._reason = self._execute(command)
            except Cancelled:
                self._reason = "paused"
            except InputError as error:
                self._problem = str(error)
            except Exception as error:  # whatever a step throws must not end the debugger
                logging.getLogger(__name__).exception("the engine failed")
                self._problem = f"{type(error).__name__}: {error}"
            if self._problem:
                self._problems += 1
                self._reason = f"stopped by a problem: {self._problem}"
            with self._changed:
                self._activity, self._rival = Activity.PAUSED, None
                self._publish()

    def _answer(self, ask: Query) -> None:
        try:
            answer = ask.question(self._session)
        except Cancelled:  # a command is waiting; the question comes after it
            with self._changed:
                if not any(isinstance(c, Query) and c.asker is ask.asker for c in self._commands):
                    self._commands.append(ask)
            return
        except Exception as error:
            answer = error
        try:
            ask.answer(answer)
        except Exception:  # the asker's trouble is not the engine's
            logging.getLogger(__name__).exception("an answer could not be taken")
        self.republish()

    def _execute(self, command: Command) -> str:
        """Do it; returns why it stopped."""
        session = self._session
        match command:
            case Forward(extent):
                return self._advance(extent)
            case Run(until):
                return self._advance(None, until)
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
            case ToBeginning(extent):
                session.go_to(beginning_of(session.trace.steps, session.moment, session.position, extent))
                return f"at the beginning of the {extent.name.lower()}"
            case Play(rate):
                return self._play(rate)
            case Restart(options):
                self._keep(self._from_start(options or session.options), 0)
                return "restarted; the record so far is kept among the runs"
            case Branch(options):
                self._keep(session.branch(options), session.moment)
                return f"goes on from moment {session.moment} with other options; the record so far is kept"
            case Place(vertices, positions):
                return step_by_hand(session, vertices, lambda s, ids: s.place(ids, np.array(positions)), self._keep)
            case Reset(vertices):
                return step_by_hand(session, vertices, lambda s, ids: s.reset(ids), self._keep)
            case Lock(vertices, locked):
                return lock_by_hand(self._runs, vertices, locked, self._keep)
            case SwitchTo(run_id, moment):
                self._runs.switch(run_id)
                if moment is not None:
                    self._session.go_to(min(moment, len(self._session.trace)))
                return f"run {run_id} is at hand"
            case DeleteRun(run_id):
                self._runs.delete(run_id)
                with self._changed:
                    self._bookmarks = self._bookmarks.without_run(run_id)
                return f"run {run_id} is deleted"
            case Race(first, second):
                return self._race(first, second)
            case Pause() | Query():
                return self._reason

    def _advance(self, extent: Extent | None, until: Condition | None = None) -> str:
        session = self._session
        if session.finished:
            return session.stop_reason
        began, self._stopped = session.position, session.vertices
        while not session.finished:
            is_new = session.moment == len(session.trace)
            started = time.perf_counter()
            session.step()
            if is_new:
                self._step_seconds.append(time.perf_counter() - started)
            stop = "" if extent is Extent.ITERATION else self._ask_breakpoints()
            if stop:
                return stop
            if until is not None and self._holds(until):
                return f"until {until.text}"
            # What is done to the start is a step of its own, at the position of the first iteration.
            if extent is Extent.ITERATION or (extent is not None and session.position[:extent] != began[:extent]):
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
        session, moment = self._session, self._session.moment
        around = Around(session, self._stopped)
        # Some questions take long: nobody waits for their answers meanwhile.
        before = self._breakpoints
        after, hit = before.asked(session.trace.steps[moment - 1], moment, around)
        with self._changed:
            if self._breakpoints is before:
                self._breakpoints = after
        for item in hit:
            if item.logs:
                self._log.append(f"moment {moment}: {item.condition.text}")
        stops = [item.condition.text for item in hit if not item.logs]
        return f"breakpoint: {', '.join(stops)}" if stops else ""

    def _holds(self, condition: Condition) -> bool:
        """Of the step just made."""
        session, moment = self._session, self._session.moment
        around = Around(session, self._stopped)
        return condition.holds(quantities_of(session.trace.steps[moment - 1], moment, around))

    def _run_back(self) -> str:
        session = self._session
        self._stopped = session.vertices
        for moment in range(session.moment - 1, 0, -1):
            session.go_to(moment)
            if stop := self._ask_breakpoints():
                return stop
            if self._interrupt.is_set():
                return "paused"
        session.go_to(0)
        return "at the start"

    def _play(self, rate: float) -> str:
        """A film of what is recorded; breakpoints are for what happens, not for films."""
        session, rate = self._session, min(max(rate, 1 / MAX_PLAY_RATE), MAX_PLAY_RATE)
        last = len(session.trace)
        if session.moment == last:
            session.go_to(0)
        began, first = time.monotonic(), session.moment
        while session.moment < last:
            self._publish()
            due = began + (session.moment + 1 - first) / rate - time.monotonic()
            if self._interrupt.wait(max(due, PUBLISH_EVERY)):
                return "paused"
            session.go_to(min(last, max(session.moment + 1, first + int((time.monotonic() - began) * rate))))
        return "at the end of the record"

    def _race(self, first: FairingOptions, second: FairingOptions) -> str:
        if first == second:
            raise InputError("a race needs two runs with different options")
        racing: list[int] = []
        for options in (first, second):
            run_id = self._runs.from_start_with(options)
            racing.append(self._keep(self._from_start(options), 0, wanted=racing) if run_id is None else run_id)
        self._rival = racing[0]
        self._runs.switch(racing[1])
        sessions = [self._runs.of(run_id) for run_id in racing]
        for session in sessions:
            session.go_to(len(session.trace))
        try:
            while behind := [session for session in sessions if not session.finished]:
                min(behind, key=lambda session: session.seconds["steps"]).step()
                if self._interrupt.is_set():
                    return "paused; race again to go on"
                if time.monotonic() - self._published > PUBLISH_EVERY:
                    self._publish()
        finally:
            sessions[0].forget_computed()
        return f"both runs are at their ends: {sessions[0].moment} and {sessions[1].moment} steps"

    def _from_start(self, options: FairingOptions) -> Session:
        session = self._session
        moment = session.moment
        session.go_to(0)
        try:
            return session.branch(options)
        finally:
            session.go_to(moment)

    def _keep(self, session: Session, forked_at: int, note: str = "", wanted: Collection[int] = ()) -> int:
        """Take a new run to hand; those there are stay."""
        session.cancel_requested = self._interrupt.is_set
        return self._runs.add(session, forked_at, note, wanted)

    # ------------------------------------------------------------------ telling about it

    def _mean_step_seconds(self) -> float:
        return sum(self._step_seconds) / len(self._step_seconds) if self._step_seconds else 0.0

    def _snapshot(self) -> RunState:
        session = self._session
        self._serial += 1
        return RunState(
            serial=self._serial,
            run_id=self._runs.run_id,
            runs=self._runs.infos(),
            rival=self._rival,
            trace=session.trace,
            moment=session.moment,
            length=len(session.trace),
            vertices=session.vertices,
            locked=session.locked,
            position=session.position,
            options=session.options,
            activity=self._activity,
            finished=session.finished,
            reason=self._reason,
            problem=self._problem,
            problems=self._problems,
            progress=session.progress,
            step_seconds=self._mean_step_seconds(),
            breakpoints=self._breakpoints.items,
            bookmarks=self._bookmarks.items,
            log=tuple(self._log),
        )

    def _publish(self) -> None:
        with self._changed:
            self._state = self._snapshot()
            self._untold = True
            self._published = time.monotonic()
            self._changed.notify_all()

    def _say_at_work(self) -> None:
        """A step that takes long has not published anything yet: say at least that it is at work."""
        working = self._activity is not Activity.PAUSED and self._state.activity is Activity.PAUSED
        if working and time.monotonic() - self._at_work_since > SLOW_STEP:
            self._serial += 1
            self._state = replace(self._state, serial=self._serial, activity=self._activity)
            self._untold = True

    def _tell(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._untold or self._closing, timeout=SLOW_STEP)
                if self._closing:
                    return
                self._say_at_work()
                if not self._untold:
                    continue
                state, listeners = self._state, list(self._listeners)
                self._untold = False
            for listener in listeners:
                try:
                    listener(state)
                except Exception:  # one page's trouble is not another's
                    logging.getLogger(__name__).exception("a listener failed")


def _activity_of(command: Command) -> Activity:
    if isinstance(command, Play):
        return Activity.PLAYING
    return Activity.RUNNING if isinstance(command, Run | Race) else Activity.STEPPING


def beginning_of(steps: list[StepRecord], moment: int, position: SchedulePosition, extent: Extent) -> int:
    """The moment at which the unit, sweep or level of `position`, where the step after `moment` belongs, began."""
    while moment > 0 and steps[moment - 1].position[:extent] == position[:extent]:
        moment -= 1
    return moment


def boundary_before(steps: list[StepRecord], moment: int, extent: Extent) -> int:
    """The moment at which the iteration, unit, sweep or level of the step before `moment` began."""
    if moment <= 0:
        return 0
    group = steps[moment - 1].position[:extent]
    began = moment - 1
    while extent is not Extent.ITERATION and began > 0 and steps[began - 1].position[:extent] == group:
        began -= 1
    return began
