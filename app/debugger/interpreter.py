"""Interpreter: executes one command on the runs. Runs on the engine thread."""

import time
from collections import deque
from collections.abc import Callable, Collection
from pathlib import Path

from app.debugger.actions import BLOCK_NAMES, BLOCK_STEPS
from app.debugger.cancellation import Cancellation
from app.debugger.commands import (
    Back,
    Branch,
    Command,
    DeleteRun,
    Extent,
    Forward,
    JumpTo,
    LoadOwn,
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
    SaveReport,
    SwitchTo,
    ToBeginning,
)
from app.debugger.condition import Condition
from app.debugger.manual_edits import check_positions, check_vertices, lock_manually, step_manually
from app.debugger.markers import Markers
from app.debugger.playback import play
from app.debugger.quantities import StepContext, quantities_of
from app.debugger.race import race
from app.debugger.runs import Runs
from app.debugger.schedule_extents import Extents, Group
from app.debugger.step_text import step_outcome
from fairing.errors import Cancelled
from fairing.options import FairingOptions
from fairing.run.own_files import load_own
from fairing.run.session import Session

STEPS_TIMED = 8  # recent steps in the mean computing time


class Interpreter:
    """What every command does.

    Args:
        runs: changed by the commands.
        publish: publishes the present state.
        publish_when_due: the same as soon as enough time has passed since the last publication; called between steps.
        save_report: writes the problem report and returns its path.
    """

    def __init__(
        self,
        runs: Runs,
        markers: Markers,
        cancellation: Cancellation,
        publish: Callable[[], None],
        publish_when_due: Callable[[], None],
        save_report: Callable[[], Path],
    ) -> None:
        self._runs, self._markers, self._cancellation = runs, markers, cancellation
        self._publish, self._publish_when_due, self._save_report = publish, publish_when_due, save_report
        self._stopped = runs.session.vertices
        self._step_seconds: deque[float] = deque(maxlen=STEPS_TIMED)
        self.rival: int | None = None
        """The run that races with the current one."""
        for session in runs.sessions:
            session.cancel_requested = cancellation.requested

    @property
    def step_seconds(self) -> float:
        """Mean computing time of the recent steps, s; 0 before the first."""
        return sum(self._step_seconds) / len(self._step_seconds) if self._step_seconds else 0.0

    def execute(self, command: Command) -> str:
        """Execute a command other than `Pause` and `Query`; returns why it stopped.

        Raises:
            InputError: the command is not possible; nothing has changed.
            Cancelled: another command arrived; the step in progress is dropped.
        """
        session = self._session
        match command:
            case Forward(extent, passes_breakpoints):
                return self._advance(extent, stops=extent is not Extent.ITERATION and not passes_breakpoints)
            case Run(until, passes_breakpoints):
                return self._advance(None, until, stops=not passes_breakpoints)
            case RunBack():
                return self._run_back()
            case Back(extent):
                if session.moment == 0:
                    return "at the start"
                session.go_to(Extents(session.trace, extent).boundary_before(session.moment))
                return f"stepped back {_steps_of(extent, session)}"
            case JumpTo(moment):
                _go_to(session, moment)
                return f"jumped to moment {session.moment}"
            case ToBeginning(extent):
                extents = Extents(session.trace, extent)
                session.go_to(extents.beginning_of(session.moment, extents.group_of_next_step(session)))
                return f"at the beginning of the {_name_of(extent, session)}"
            case Play(rate):
                return play(session, rate, self._cancellation, self._publish)
            case Restart(options):
                self._add(self._from_start(options or session.options), 0)
                return "restarted; the previous run is kept"
            case Branch(options):
                self._add(session.branch(options), session.moment)
                return f"branched at moment {session.moment} with other options; the previous run is kept"
            case LoadOwn(files):
                return self._load_own(files)
            case Place(vertices, positions):
                ids = check_vertices(session, vertices)
                places = check_positions(ids, positions)
                return step_manually(session, ids, lambda acting: acting.place(ids, places), self._add)
            case Reset(vertices):
                ids = check_vertices(session, vertices)
                return step_manually(session, ids, lambda acting: acting.reset(ids), self._add)
            case Lock(vertices, locked):
                return lock_manually(self._runs, check_vertices(session, vertices), locked, self._add)
            case SwitchTo(run_id, moment):
                self._runs.switch(run_id)
                if moment is not None:
                    _go_to(self._session, moment)
                return f"switched to run {run_id}"
            case DeleteRun(run_id):
                self._runs.delete(run_id)
                self._markers.edit_bookmarks(lambda bookmarks: bookmarks.without_run(run_id))
                return f"deleted run {run_id}"
            case Race(first, second):
                return self._race(first, second)
            case SaveReport():
                return f"problem report saved: {self._save_report()}"
            case Pause() | Query():
                raise AssertionError("the controller handles these")

    @property
    def _session(self) -> Session:
        return self._runs.session

    def _load_own(self, files: Collection[Path]) -> str:
        """Branch with the code of files as it is saved: at the present moment, or where the first changed stage of a plan began."""
        session, own = self._session, load_own(files)
        plan = None if own.plan == session.own_plan else own.plan
        names = [each.name for each in (*own.terms, own.norm) if each is not None]
        if plan is not None:
            names.append("the plan")
        elif not names:
            return "the plan as saved is the present one; nothing has changed"
        branch = session.branch(terms=own.terms, norm=own.norm, plan=plan)
        self._add(branch, branch.moment)
        return f"branched at moment {branch.moment} with {', '.join(names)} as saved; the previous run is kept"

    def _advance(self, extent: Extent | None, until: Condition | None = None, *, stops: bool) -> str:
        session = self._session
        if session.finished:
            return session.stop_reason
        began: Group | None = None
        extents = None if extent is None else Extents(session.trace, extent)
        self._stopped = session.vertices
        while not session.finished:
            is_new, is_planned = session.moment == len(session.trace), session.trace.plan is not None
            started = time.perf_counter()
            session.step()
            if is_new and is_planned:  # the first step also plans the run
                self._step_seconds.append(time.perf_counter() - started)
            if extents is not None:
                began = began or extents.group_of_step(session.moment - 1)
            if stops and (stop := self._markers.check(session, self._stopped)):
                return stop
            if until is not None and self._holds(until):
                return f"stopped where {until.text}"
            # What is done to the start is a step of its own, at the position of the first iteration.
            if extent is Extent.ITERATION or (extents is not None and extents.group_of_next_step(session) != began):
                break
            if self._cancellation.requested():
                return "paused"
            self._publish_when_due()
        if session.finished:
            return session.stop_reason
        return step_outcome(session.trace.steps[session.moment - 1])

    def _holds(self, condition: Condition) -> bool:
        """Whether a condition holds after the step just made."""
        session, moment = self._session, self._session.moment
        context = StepContext(session, self._stopped)
        return condition.holds(quantities_of(session.trace.steps[moment - 1], moment, context))

    def _run_back(self) -> str:
        session = self._session
        self._stopped = session.vertices
        for moment in range(session.moment - 1, 0, -1):
            session.go_to(moment)
            if stop := self._markers.check(session, self._stopped):
                return stop
            if self._cancellation.requested():
                return "paused"
        session.go_to(0)
        return "at the start"

    def _race(self, first: FairingOptions, second: FairingOptions) -> str:
        def start(options: FairingOptions, keep: Collection[int]) -> int:
            return self._add(self._from_start(options), 0, keep=keep)

        try:
            return race(self._runs, (first, second), start, self._before_race_step)
        finally:
            self.rival = None

    def _before_race_step(self, rival: int) -> bool:
        """Publish if it is time; returns whether to stop."""
        self.rival = rival
        self._publish_when_due()
        return self._cancellation.requested()

    def _from_start(self, options: FairingOptions) -> Session:
        """A new session at the start of the current run, with other options."""
        session = self._session
        moment = session.moment
        session.go_to(0)
        try:
            return session.branch(options)
        finally:
            session.go_to(moment)

    def _add(self, session: Session, forked_at: int, note: str = "", keep: Collection[int] = ()) -> int:
        """Switch to a new run and keep the existing ones."""
        if self._cancellation.is_abandoned:
            raise Cancelled
        session.cancel_requested = self._cancellation.requested
        return self._runs.add(session, forked_at, note, keep)


def _name_of(extent: Extent, session: Session) -> str:
    """What an extent is called in the order of the run's schedule."""
    return BLOCK_NAMES[session.options.schedule.order] if extent is Extent.BLOCK else extent.name.lower()


def _steps_of(extent: Extent, session: Session) -> str:
    order = session.options.schedule.order
    return BLOCK_STEPS.get(order, "one vertex") if extent is Extent.BLOCK else f"one {extent.name.lower()}"


def _go_to(session: Session, moment: int) -> None:
    """Go to a moment; beyond the record, or negative: to its last one."""
    last = len(session.trace)
    session.go_to(moment if 0 <= moment <= last else last)
