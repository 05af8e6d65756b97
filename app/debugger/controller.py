"""Controller: accepts commands from any thread, executes them on the engine thread and publishes the states.

The engine thread owns the session (`Interpreter` has the commands' meaning), the publisher delivers states, the
supervisor replaces either thread if it dies or does not respond. Independent of the browser.
"""

import logging
import threading
import time
import traceback
from collections.abc import Callable, Hashable
from functools import partial
from pathlib import Path
from typing import Any, Literal

from app.debugger.actions import label_of
from app.debugger.bookmarks import Bookmarks, file_beside, read_bookmarks, write_bookmarks
from app.debugger.breakpoints import Breakpoints
from app.debugger.cancellation import Cancellation
from app.debugger.command_queue import CommandQueue
from app.debugger.commands import Command, JumpTo, Pause, Play, Query, Race, Run
from app.debugger.compile_watch import compiling
from app.debugger.engine_compilation import EngineCompilation
from app.debugger.incidents import Incidents, Kind
from app.debugger.interpreter import Interpreter
from app.debugger.markers import Markers
from app.debugger.problem_report import problem_report, report_path, write_report
from app.debugger.publisher import Listener, Publisher
from app.debugger.run_state import Activity, RunState
from app.debugger.runs import Runs
from app.debugger.session_snapshot import snapshot_of
from app.debugger.supervisor import Supervisor, Watched
from app.debugger.sweep_progress import SweepProgress
from app.debugger.work_report import report_of
from app.worker_thread import WorkerThread
from fairing.errors import Cancelled, InputError
from fairing.run.session import Session
from fairing.scene import Scene

SLOW_STEP = 0.15  # s: a command in progress for longer is announced before it publishes
WORK_EVERY = 0.4  # s between two reports of what a command does
# A thread that does not respond for so long counts as stuck, s. Compiling the engine cannot be cancelled and takes a minute
# and more on a slow machine; a listener sends messages and is done within milliseconds.
ENGINE_LIMIT, PUBLISHER_LIMIT = 180.0, 60.0


class Controller:
    """Drives the runs of one scene.

    A command posted during a run stops the run first. See `CommandQueue` for which commands replace waiting ones.

    Args:
        session: the first run; used by the engine thread only from now on.
        save_to: write the record to this file.
        recorded_in: the file the record was read from; its bookmarks are read and kept in the file beside it.
        limits: seconds after which the engine and the publisher count as stuck.
        compilation: the first compilation of the engine, which commands wait for; None if the engine is compiled.

    Raises:
        InputError: `save_to` cannot be written, or the bookmarks cannot be read.
    """

    def __init__(
        self,
        session: Session,
        save_to: Path | None = None,
        recorded_in: Path | None = None,
        limits: tuple[float, float] = (ENGINE_LIMIT, PUBLISHER_LIMIT),
        compilation: EngineCompilation | None = None,
    ) -> None:
        self._compilation = compilation
        self._command: Command | None = None
        self._sweep_progress = SweepProgress()
        self.scene: Scene = session.scene
        self._changed = threading.Condition()
        self._runs = Runs(session, save_to, recorded_in)
        self._report_path = report_path(save_to or recorded_in, session.scene.name)
        read = Bookmarks() if recorded_in is None else read_bookmarks(file_beside(recorded_in), len(session.trace))
        self._markers = Markers(self._changed, read)
        self._queue = CommandQueue()
        self._incidents = Incidents()
        self._activity, self._active_since, self._work_due = Activity.PAUSED, 0.0, 0.0
        self._is_querying = self._is_closed = False
        self._recovery = ""  # "dead" or "stuck" until the new engine thread has resumed
        self._reason = session.stop_reason if session.finished else "ready"
        self._problem, self._problems = "", 0
        self._cancellation = Cancellation()
        self._interpreter = self._new_interpreter()
        self._engine: WorkerThread[Callable[[], None]] = WorkerThread(
            "engine", self._changed, self._take, lambda job: job()
        )
        self._publisher = Publisher(self._changed, self._first_state(), self._polled, self._on_listener_failure)
        self._engine.start()
        self._publisher.worker.start()
        self._supervisor = Supervisor(
            (
                Watched(self._engine, self._unresponsive_seconds, limits[0], self._recover_engine),
                Watched(self._publisher.worker, self._publisher.busy_seconds, limits[1], self._recover_publisher),
            )
        )

    # ------------------------------------------------------------------ for any thread

    @property
    def state(self) -> RunState:
        """The newest state."""
        return self._publisher.state

    @property
    def activity(self) -> Activity:
        """What the engine thread is doing, which the newest state may not show yet."""
        return self._activity

    def post(self, command: Command) -> None:
        """Add a command to the queue and return at once."""
        with self._changed:
            is_repeated = isinstance(command, Run) and self._activity is Activity.RUNNING
            if self._is_closed or is_repeated or not self._queue.add(command):
                return
            is_busy = self._is_querying or self._activity in (Activity.RUNNING, Activity.PLAYING)
            if not isinstance(command, Query) and (is_busy or isinstance(command, Pause | JumpTo)):
                self._cancellation.request()
            self._changed.notify_all()

    def query(self, key: Hashable, compute: Callable[[Session], Any], callback: Callable[[Any], None]) -> None:
        """Post a `Query`."""
        self.post(Query(key, compute, callback))

    def subscribe(self, listener: Listener) -> Callable[[], None]:
        """Call `listener` with the present state and all later ones. Returns a function that ends the subscription."""
        return self._publisher.subscribe(listener)

    def republish(self) -> None:
        """Deliver the present state again, for example because a page shows it in another way from now on."""
        self._publisher.republish()

    def file_of(self, run_id: int) -> Path | None:
        """The file with the record of a run; None if there is none."""
        return self._runs.file_of(run_id)

    def edit_breakpoints(self, edit: Callable[[Breakpoints], Breakpoints]) -> None:
        """Replace the breakpoints by the result of `edit`. Raises what `edit` raises."""
        with self._changed:
            self._markers.edit_breakpoints(edit)
            self._publisher.update(breakpoints=self._markers.breakpoints.items)

    def edit_bookmarks(self, edit: Callable[[Bookmarks], Bookmarks]) -> None:
        """Replace the bookmarks by the result of `edit`, and write the files of runs whose bookmarks changed.

        Raises:
            InputError: a file cannot be written; the bookmarks are changed nevertheless. Or what `edit` raises.
        """
        with self._changed:
            before = self._markers.bookmarks
            self._markers.edit_bookmarks(edit)
            after = self._markers.bookmarks
            self._publisher.update(bookmarks=after.items)
        for run in self.state.runs:
            file = self._runs.file_of(run.run_id)
            if file is not None and before.of_run(run.run_id) != after.of_run(run.run_id):
                write_bookmarks(file_beside(file), after.of_run(run.run_id))

    def save_report(self, path: Path | None = None) -> Path:
        """Write a problem report; returns its path, by default that of `report_path`.

        Raises:
            InputError: the file cannot be written.
        """
        workers = (self._engine, self._publisher.worker)
        with self._changed:
            incidents, commands = self._incidents.items, tuple(self._queue.history)
        path = path or self._report_path
        stacks = {worker.name: worker.stack() for worker in workers}
        write_report(path, problem_report(self.scene, self.state, incidents, commands, stacks))
        return path.resolve()

    def wait_until_idle(self, timeout: float = 300.0) -> RunState:
        """Wait until all commands are done and return the state; queries may still wait.

        Raises:
            TimeoutError: the engine is busy after `timeout` seconds.
        """
        with self._changed:
            is_idle = self._changed.wait_for(
                lambda: not self._queue.has_commands and self._activity is Activity.PAUSED and not self._recovery,
                timeout,
            )
        if not is_idle:
            raise TimeoutError(f"the engine was still busy after {timeout:g} s")
        return self.state

    def close(self) -> None:
        """Cancel the command in progress, end the threads and close the files."""
        self._supervisor.close()
        with self._changed:
            self._is_closed = True
            self._queue.clear()
            self._cancellation.request()
        self._engine.close(timeout=30)
        self._publisher.worker.close(timeout=5)
        self._runs.close()

    # ------------------------------------------------------------------ on the engine thread

    def _take(self) -> Callable[[], None] | None:
        """The next job of the engine thread."""
        if self._recovery:
            job, self._recovery = partial(self._resume, self._recovery), ""
            return job
        command = self._queue.take()
        if command is None:
            return None
        if isinstance(command, Query):
            self._is_querying, self._active_since = True, time.monotonic()
            return partial(self._compute, command)
        self._cancellation.clear()
        self._activity, self._active_since = _activity_of(command), time.monotonic()
        self._command = command
        self._problem = ""
        return partial(self._execute, command, self._interpreter, self._cancellation)

    def _execute(self, command: Command, interpreter: Interpreter, cancellation: Cancellation) -> None:
        reason = self._reason
        problem = ""
        try:
            if self._activity is not Activity.STEPPING:
                self._publish()
            if not isinstance(command, Pause):
                if self._compilation is not None:
                    self._compilation.wait(cancellation.requested)
                reason = interpreter.execute(command)
        except Cancelled:
            reason = "paused"
        except InputError as error:
            problem = str(error)
        except Exception as error:
            logging.getLogger(__name__).exception("a command failed")
            problem = f"{type(error).__name__}: {error}"
            self._add_incident("error", type(command).__name__, problem, traceback.format_exc())
        with self._changed:
            if cancellation.is_abandoned:
                return
            self._reason = f"stopped by a problem: {problem}" if problem else reason
            if problem:
                self._problem = problem
                self._problems += 1
        self._publish(Activity.PAUSED)

    def _compute(self, query: Query) -> None:
        try:
            if self._compilation is not None:
                self._compilation.wait(self._cancellation.requested)
            result = query.compute(self._runs.session)
        except Cancelled:  # commands go first
            with self._changed:
                self._is_querying = False
                self._queue.add_again(query)
            return
        except Exception as error:
            result = error
        with self._changed:
            self._is_querying = False
        try:
            query.callback(result)
        except Exception as error:
            logging.getLogger(__name__).exception("the callback of a query failed")
            self._add_incident("error", "query", f"{type(error).__name__}: {error}", traceback.format_exc())
        self.republish()

    def _resume(self, what: str) -> None:
        """The first job of an engine thread that replaces another."""
        try:
            if what == "stuck":
                self._runs.renew()
        except InputError as error:
            with self._changed:
                self._problem = f"{self._problem} {error}"
        self._interpreter = self._new_interpreter()
        self._publish(Activity.PAUSED)

    def _publish_when_due(self) -> None:
        self._publish(when_due=True)

    def _publish(self, activity: Activity | None = None, *, when_due: bool = False) -> None:
        """Publish the present state, with another activity if given; at once, or as soon as a state is due.

        The session is read without the lock. If that fails, the last state of the session is published again.
        """
        if not self._engine.is_current:
            return
        try:
            fields = self._session_fields()
        except Exception as error:
            self._on_property_failure("state", error)
            fields = {}
        with self._changed:
            if self._engine.is_current:
                self._activity = activity or self._activity
                update = self._publisher.update_when_due if when_due else self._publisher.update
                update(**fields, **self._status_fields())

    # ------------------------------------------------------------------ states

    def _first_state(self) -> RunState:
        return RunState(serial=1, **self._session_fields(), **self._status_fields())

    def _session_fields(self) -> dict[str, Any]:
        snapshot = snapshot_of(self._runs.session, self._on_property_failure)
        return {"run_id": self._runs.run_id, "runs": self._runs.infos()} | snapshot._asdict()

    def _status_fields(self) -> dict[str, Any]:
        return {
            "rival": None if self._activity is Activity.PAUSED else self._interpreter.rival,
            "activity": self._activity,
            "reason": self._reason,
            "problem": self._problem,
            "problems": self._problems,
            "incident": self._incidents.latest,
            "step_seconds": self._interpreter.step_seconds,
            "breakpoints": self._markers.breakpoints.items,
            "bookmarks": self._markers.bookmarks.items,
            "log": self._markers.log,
            "waiting": self._queue.labels,
        } | ({"work": None} if self._activity is Activity.PAUSED else {})

    def _polled(self) -> dict[str, Any]:
        """Activity and progress of a command or query that has taken `SLOW_STEP` already, and the commands that wait."""
        compilation = None if self._compilation is None else self._compilation.report
        is_paused = self._activity is Activity.PAUSED
        if is_paused and not self._is_querying:
            return {"work": compilation}
        if time.monotonic() - self._active_since < SLOW_STEP:
            return {}
        waiting, command = self._queue.labels, None if is_paused else self._command
        if compilation is not None and command is not None:
            waiting = (label_of(command), *waiting)
        fields: dict[str, Any] = {"activity": self._activity, "waiting": waiting}
        if time.monotonic() > self._work_due:
            self._work_due = time.monotonic() + WORK_EVERY
            session = self._runs.session
            works = session.work.current
            report = self._sweep_progress.report(session, command, self._active_since) or report_of(works)
            fields["work"] = compilation or compiling() or report
        return fields

    # ------------------------------------------------------------------ failures

    def _new_interpreter(self) -> Interpreter:
        return Interpreter(
            self._runs,
            self._markers,
            self._cancellation,
            self._publish,
            self._publish_when_due,
            self.save_report,
        )

    def _add_incident(self, what: Kind, where: str, summary: str, details: str) -> bool:
        with self._changed:
            return self._incidents.add(what, where, summary, details)

    def _notify(self, problem: str) -> None:
        """Show a problem; the caller holds the lock and publishes."""
        self._problem = problem
        self._problems += 1

    @property
    def _hint(self) -> str:
        return f"The command 'Save a problem report' writes the details to {self._report_path}."

    def _on_property_failure(self, name: str, error: Exception) -> None:
        summary = f"the state of the session could not be read ({type(error).__name__}: {error})"
        details = "".join(traceback.format_exception(error))
        with self._changed:
            if self._incidents.add("error", f"session.{name}", summary, details):
                logging.getLogger(__name__).error(summary, exc_info=error)
                self._notify(f"{summary}. {self._hint}")

    def _on_listener_failure(self, error: Exception) -> None:
        self._add_incident(
            "error", "listener", f"{type(error).__name__}: {error}", "".join(traceback.format_exception(error))
        )

    def _unresponsive_seconds(self) -> float:
        """Time since the command or query in progress was asked to stop."""
        return min(self._engine.busy_seconds, self._cancellation.seconds)

    def _recover_engine(self, what: Literal["dead", "stuck"], details: str) -> None:
        """Replace the engine thread. Waiting commands are dropped; records, breakpoints and queries are kept."""
        with self._changed:
            summary = _summary("engine", what, details)
            self._incidents.add(what, "engine", summary, details)
            self._notify(f"{summary} The record is kept. {self._hint}")
            self._reason = "stopped by a problem: the engine thread was restarted"
            self._cancellation.abandon()
            self._cancellation = Cancellation()
            self._queue.drop_commands()
            self._is_querying, self._recovery = False, what
            self._engine.restart()

    def _recover_publisher(self, what: Literal["dead", "stuck"], details: str) -> None:
        with self._changed:
            summary = _summary("publisher", what, details)
            self._incidents.add(what, "publisher", summary, details)
            self._notify(f"{summary} {self._hint}")
            self._publisher.worker.restart()
            self._publisher.update(problem=self._problem, problems=self._problems, incident=self._incidents.latest)


def _summary(thread: str, what: Literal["dead", "stuck"], details: str) -> str:
    if what == "stuck":
        return f"The {thread} thread did not respond and was replaced."
    cause = details.strip().splitlines()[-1] if details.strip() else "no traceback"
    return f"The {thread} thread ended unexpectedly ({cause}) and was restarted."


def _activity_of(command: Command) -> Activity:
    if isinstance(command, Play):
        return Activity.PLAYING
    return Activity.RUNNING if isinstance(command, Run | Race) else Activity.STEPPING
