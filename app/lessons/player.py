"""Lesson player: posts the actions of lesson steps to the controller and records the moment at which each step ended.

Users may explore at any time. The player posts commands only when the user navigates in the lesson, and they can be
paused. Every step ends at a moment of a run, so going back to a step, or resuming it, is a jump to that moment.
"""

import logging
import threading
from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from enum import Enum
from functools import partial
from typing import TypeVar

from app.debugger.commands import (
    Branch,
    Command,
    Forward,
    Pause,
    Place,
    Query,
    Race,
    Restart,
    Run,
    SwitchTo,
)
from app.debugger.compare import Reference
from app.debugger.controller import Controller
from app.debugger.option_fields import changed_options
from app.debugger.run_state import RunState
from app.debugger.runs import RunInfo
from app.lessons.engine_actions import Advance, Continue, EngineAction, PlaceVertex, RacedRuns, StartRun, SwitchRun
from app.lessons.facts import facts_of, values_used
from app.lessons.lesson import ANY_SCENE, Lesson, LessonStep, Switches
from app.lessons.page_settings import PageSettings
from app.lessons.progress import Ended, Findings, LessonProgress
from app.lessons.scenes import is_lesson_scene
from app.page_state.page_state import PageState
from fairing.errors import InputError
from fairing.run.session import Session

_Found = TypeVar("_Found")

CUT_SHORT = ("paused",)  # reasons with which a command stops before its end


class Status(Enum):
    """State of the current step: actions running, done, interrupted by a pause, or failed."""

    AT_WORK = "at work"
    THERE = "there"
    CUT_SHORT = "cut short"
    FAILED = "failed"


@dataclass(frozen=True)
class _Examine:
    """Request to compute the findings of a step."""

    step: int


@dataclass(frozen=True)
class _Measure:
    """Request to measure the end of a branch of a step's switches."""

    step: int
    off: frozenset[int]


_Script = Generator["Command | _Examine | _Measure", RunState, None]


class Player:
    """The lesson of one browser.

    Args:
        on_change: called when the page must be updated.
    """

    def __init__(self, controller: Controller, on_change: Callable[[], None]) -> None:
        self._controller, self._on_change = controller, on_change
        self._lock = threading.RLock()
        self.lesson: Lesson | None = None
        self.step = 0
        self.status = Status.THERE
        self.problem = ""
        self.findings: dict[int, Findings] = {}
        self.chosen: dict[int, int] = {}
        self.off: dict[int, frozenset[int]] = {}
        self.measured: dict[tuple[int, frozenset[int]], float] = {}
        self._branches: dict[tuple[int, frozenset[int]], Ended] = {}
        self._kept: dict[str, float] = {}
        self._runs: dict[str, int] = {}
        self._ends: dict[int, Ended] = {}
        self._script: _Script | None = None
        self._requested: Command | _Examine | _Measure | None = None
        self._stopped_at: Ended | None = None
        self._turn = 0
        self._settings_due: bool | None = None

    # ------------------------------------------------------------------ for the page

    def fits(self, lesson: Lesson) -> bool:
        """Whether the current scene is that of the lesson."""
        return lesson.scene == ANY_SCENE or is_lesson_scene(lesson.scene, self._controller.scene)

    def open(self, lesson: Lesson) -> None:
        """Begin a lesson at its first step.

        Raises:
            InputError: it needs another scene.
        """
        if not self.fits(lesson):
            raise InputError(f"lesson {lesson.name}: needs another scene, {lesson.scene}")
        with self._lock:
            self.lesson = lesson
            self.findings, self.chosen, self._kept, self._runs, self._ends = {}, {}, {}, {}, {}
            self.off, self.measured, self._branches = {}, {}, {}
            self.go(0)

    @property
    def progress(self) -> LessonProgress | None:
        """How far the lesson has come; None without one."""
        with self._lock:
            if self.lesson is None:
                return None
            return LessonProgress(
                self.lesson,
                self.step,
                dict(self.findings),
                dict(self.chosen),
                dict(self.measured),
                dict(self._branches),
                dict(self._kept),
                dict(self._runs),
                dict(self._ends),
            )

    def resume(self, progress: LessonProgress) -> None:
        """Go on with a lesson of this scene where another player has left it."""
        with self._lock:
            self._drop_work()
            self.lesson, self.step, self.off = progress.lesson, progress.step, {}
            self.findings, self.chosen, self.measured = (
                dict(progress.findings),
                dict(progress.chosen),
                dict(progress.measured),
            )
            self._branches, self._kept = dict(progress.branches), dict(progress.kept)
            self._runs, self._ends = dict(progress.runs), dict(progress.ends)
            self.go(progress.step)

    def leave(self) -> None:
        """Interrupt what is running: the page of this player has gone."""
        with self._lock:
            self._drop_work()

    def close(self) -> None:
        """Close the lesson. The run stays at its moment."""
        with self._lock:
            self._drop_work()
            self.lesson, self.status = None, Status.THERE
        self._on_change()

    def go(self, step: int) -> None:
        """Go to a step. Actions of earlier steps that have not been run yet are run first."""
        with self._lock:
            if self.lesson is None:
                return
            self._drop_work()
            target = min(max(step, 0), len(self.lesson.steps) - 1)
            self._settings_due = target <= self.step
            self.off.pop(target, None)
            self.step, self.status, self.problem = target, Status.AT_WORK, ""
            self._script = self._way_to(self.lesson, self.step)
            self._advance(None)
        self._on_change()

    def next(self) -> None:
        """Go to the next step, or continue this one if it was interrupted. No effect while its actions are running."""
        if self.status is not Status.AT_WORK:
            self.go_on() if self.status is Status.CUT_SHORT else self.go(self.step + 1)

    def back(self) -> None:
        """Go to the end of the previous step."""
        self.go(self.step - 1)

    def go_on(self) -> None:
        """Continue interrupted actions, or go back to the moment at which this step ended."""
        with self._lock:
            if self.status is not Status.CUT_SHORT or self._stopped_at is None or self._script is None:
                self.go(self.step)
                return
            self.status = Status.AT_WORK
            here, requested = self._stopped_at, self._requested
            assert requested is not None
            state = self._controller.state
            if (state.run_id, state.moment) != (here.run_id, here.moment):
                self._script = _first(SwitchTo(here.run_id, here.moment), requested, self._script)
                self._advance(None)
            else:
                self._post(requested)
        self._on_change()

    def choose(self, choice: int) -> None:
        """Answer this step's question; the first answer counts."""
        with self._lock:
            question = self.lesson.steps[self.step].question if self.lesson else None
            if question is None or choice not in range(len(question.choices)):
                raise InputError("lesson: there is no such choice")
            self.chosen.setdefault(self.step, choice)
        self._on_change()

    def switch(self, box: int) -> None:
        """Check or uncheck one of this step's check boxes, and go to the end of the branch without what is not checked.

        No effect while the engine is at work for the lesson.
        """
        with self._lock:
            switches = self.lesson.steps[self.step].switches if self.lesson else None
            if switches is None or box not in range(len(switches.options)):
                raise InputError("lesson: there is no such check box")
            if self.status is not Status.THERE or self.step not in self._ends:
                return
            self._drop_work()
            self.off[self.step] = off = self.off.get(self.step, frozenset()) ^ {box}
            self.status, self._script = Status.AT_WORK, self._compared(self.step, switches, off)
            self._advance(None)
        self._on_change()

    def take_settings(self) -> tuple[PageSettings, bool] | None:
        """The page settings that are due, returned once, and whether to repeat those that were already applied."""
        with self._lock:
            due, self._settings_due = self._settings_due, None
            return None if due is None or self.lesson is None else (self.lesson.page_settings_at(self.step), due)

    def reference(self, settings: PageSettings) -> Reference | None:
        """The run that the settings compare with; None if it does not exist yet."""
        run_id = self._runs.get(settings.compared or "")
        return None if run_id is None else Reference(run_id)

    @property
    def run_names(self) -> dict[str, int]:
        """The ids of the lesson's runs, by their names in it."""
        return dict(self._runs)

    def end_of(self, step: int) -> Ended | None:
        """The moment at which a step ended; None if it has not been reached."""
        return self._ends.get(step)

    def has_strayed(self, state: RunState, page_state: PageState) -> bool:
        """Whether the run or the page no longer match this step."""
        if self.lesson is None or self.status is not Status.THERE or self._settings_due is not None:
            return False
        off, end = self.off.get(self.step), self._ends.get(self.step)
        if off is not None:
            end = self._branches.get((self.step, off), end)
        is_elsewhere = end is not None and (state.run_id, state.moment) != (end.run_id, end.moment)
        return is_elsewhere or state.is_moving or not self.lesson.page_settings_at(self.step).is_seen_in(page_state)

    # ------------------------------------------------------------------ the way to a step

    def _way_to(self, lesson: Lesson, step: int) -> _Script:
        there = {run.run_id for run in self._controller.state.runs}
        known = [n for n in range(step + 1) if n in self._ends and self._ends[n].run_id in there]
        state = self._controller.state
        if known:
            end = self._ends[known[-1]]
            if (state.run_id, state.moment) != (end.run_id, end.moment) or state.is_moving:
                state = yield SwitchTo(end.run_id, end.moment)
        for n in range(known[-1] + 1 if known else 0, step + 1):
            for work in lesson.steps[n].actions:
                state = yield from self._do(work, state)
            self._ends[n] = Ended(state.run_id, state.moment)
            yield _Examine(n)
        if step not in self.findings:
            yield _Examine(step)

    def _compared(self, n: int, switches: Switches, off: frozenset[int]) -> _Script:
        """The branch with everything on, if it was not made yet, then that without `off`."""
        for each in (frozenset[int](), off):
            there = {run.run_id for run in self._controller.state.runs}
            made = self._branches.get((n, each))
            if made is not None and made.run_id in there:
                if each == off:
                    yield SwitchTo(made.run_id, made.moment)
                continue
            end = self._ends[n]
            state = yield SwitchTo(end.run_id, end.moment)
            state = yield Branch(changed_options(state.options, dict(switches.changes_without(each))))
            state = yield from self._do(switches.advance, state)
            self._branches[n, each] = Ended(state.run_id, state.moment)
            yield _Measure(n, each)

    def _do(self, work: EngineAction, state: RunState) -> Generator[Command, RunState, RunState]:
        match work:
            case StartRun(name, options, puts):
                run = self._made_before(work, state)
                if run is not None:
                    state = yield SwitchTo(run.run_id, len(puts))
                else:
                    state = yield Restart(options)
                    for put in puts:
                        state = yield self._place(put)
                self._runs[name] = state.run_id
            case Continue(name, changes):
                state = yield Branch(changed_options(state.options, dict(changes)))
                self._runs[name] = state.run_id
            case PlaceVertex():
                state = yield self._place(work)
            case Advance(commands):
                for command in commands:
                    state = yield command
            case RacedRuns(first, second):
                state = yield Race(first.options, second.options)
                for start in (first, second):
                    run = self._made_before(start, state)
                    if run is None:
                        raise InputError(f"run {start.name}: was deleted")
                    self._runs[start.name] = run.run_id
            case SwitchRun(name, moment):
                run = next((run for run in state.runs if run.run_id == self._runs.get(name)), None)
                if run is None:
                    raise InputError(f"run {name}: was deleted; open the lesson again")
                state = yield SwitchTo(run.run_id, run.length if moment == -1 else moment)
        return state

    def _place(self, put: PlaceVertex) -> Place:
        truth = self._controller.scene.truth
        assert truth is not None, "the scenes of lessons have a truth"
        assert truth.vertices is not None, "with true vertex positions"
        x, y, z = (truth.vertices[put.vertex] + put.offset).tolist()
        return Place((put.vertex,), ((x, y, z),))

    def _made_before(self, start: StartRun, state: RunState) -> RunInfo | None:
        """An existing run from the start with these options, and with exactly these vertices placed manually."""
        for run in state.runs:
            manual = run.trace.manual_moments
            if run.parent is not None or run.options != start.options or manual != list(range(1, len(start.puts) + 1)):
                continue
            places = [self._place(put) for put in start.puts]
            made = [run.trace.steps[n].after[0].tolist() for n in range(len(places))]
            if made == [list(place.positions[0]) for place in places]:
                return run
        return None

    # ------------------------------------------------------------------ one command after another

    def _advance(self, state: RunState | None) -> None:
        assert self._script is not None
        try:
            requested = next(self._script) if state is None else self._script.send(state)
        except StopIteration:
            self.status, self._script = Status.THERE, None
            self._settings_due = bool(self._settings_due)  # again: the names of the runs are known only now
        except Exception as error:  # with any exception the step has failed; otherwise the lesson would wait forever
            if not isinstance(error, InputError):
                logging.getLogger(__name__).exception("a lesson's step failed")
            self.status, self.problem, self._script = Status.FAILED, str(error) or type(error).__name__, None
        else:
            self._post(requested)

    def _post(self, requested: "Command | _Examine | _Measure") -> None:
        """Post a command, and a query after it that reports when the command is done; or post what is to be computed."""
        self._requested, turn = requested, self._turn
        if isinstance(requested, Run | Forward):  # a lesson's runs pass the user's breakpoints
            requested = replace(requested, passes_breakpoints=True)
        if isinstance(requested, _Examine):
            question, findings = self._examination(requested.step), partial(self._take_findings, requested.step)
            self._controller.post(Query(self, question, lambda found: self._take(turn, found, findings)))
            return
        if isinstance(requested, _Measure):
            measure, measured = self._measurement(requested), partial(self._take_measured, requested)
            self._controller.post(Query(self, measure, lambda found: self._take(turn, found, measured)))
            return
        problems = self._controller.state.problems
        self._controller.post(requested)
        self._controller.post(Query(self, lambda _: None, lambda _: self._arrived(turn, problems)))

    def _arrived(self, turn: int, problems: int) -> None:
        with self._lock:
            if turn != self._turn:
                return
            state = self._controller.state
            if state.problems > problems:
                self.status, self.problem = Status.FAILED, state.problem
            elif isinstance(self._requested, Run | Forward | Race) and state.reason.startswith(CUT_SHORT):
                self.status, self._stopped_at = Status.CUT_SHORT, Ended(state.run_id, state.moment)
            else:
                self._advance(state)
        self._on_change()

    def _drop_work(self) -> None:
        if self.status is Status.AT_WORK:
            self._controller.post(Pause())
        self._turn += 1
        self._script = self._requested = self._stopped_at = None

    # ------------------------------------------------------------------ numbers and claims

    def _examination(self, n: int) -> Callable[[Session], tuple[Findings, dict[str, float]] | None]:
        assert self.lesson is not None
        step, face, end = self.lesson.steps[n], self.lesson.page_settings_at(n).face, self._ends[n]
        kept = dict(self._kept)

        def examine(session: Session) -> tuple[Findings, dict[str, float]] | None:
            if (self._controller.state.run_id, session.moment) != (end.run_id, end.moment):
                return None  # the user has gone to another moment
            return examine_step(session, step, face, kept)

        return examine

    def _measurement(self, wanted: _Measure) -> Callable[[Session], float | None]:
        assert self.lesson is not None
        switches, face = self.lesson.steps[wanted.step].switches, self.lesson.page_settings_at(wanted.step).face
        end, kept = self._branches[wanted.step, wanted.off], dict(self._kept)
        assert switches is not None

        def measure(session: Session) -> float | None:
            if (self._controller.state.run_id, session.moment) != (end.run_id, end.moment):
                return None  # the user has gone to another moment
            return float(switches.measure.evaluate(facts_of(session, face, kept)))

        return measure

    def _take_measured(self, wanted: _Measure, found: float) -> None:
        self.measured[wanted.step, wanted.off] = found

    def _take_findings(self, n: int, found: tuple[Findings, dict[str, float]]) -> None:
        self.findings[n], self._kept = found

    def _take(self, turn: int, found: "_Found | Exception | None", keep: Callable[[_Found], None]) -> None:
        """Keep the answer of a query, unless the lesson has gone on since, and go on."""
        with self._lock:
            if turn != self._turn:
                return
            if isinstance(found, Exception):
                self.status, self.problem = Status.FAILED, str(found)
                return
            if found is not None:
                keep(found)
            self._advance(self._controller.state)
        self._on_change()


def examine_step(
    session: Session, step: LessonStep, face: int | None, kept: dict[str, float]
) -> tuple[Findings, dict[str, float]]:
    """Findings of a step at the session's current moment, and all numbers kept so far."""
    facts = facts_of(session, face, kept)
    kept = kept | {keep.name: keep.expression.evaluate(facts) for keep in step.keeps}
    facts = facts_of(session, face, kept)
    numbers = {text: expression.evaluate(facts) for text, expression in step.numbers.items()}
    claims = tuple((claim.text, claim.holds(facts)) for claim in step.claims)
    found = {
        claim.text: ", ".join(f"{name} = {value:.4g}" for name, value in values_used(claim, facts).items())
        for claim, (_, holds) in zip(step.claims, claims, strict=True)
        if not holds
    }
    return Findings(numbers, claims, found), kept


def _first(before: Command, then: "Command | _Examine | _Measure", rest: _Script) -> _Script:
    """A script that posts `before`, then the interrupted command `then`, then the rest."""
    yield before
    state = yield then
    try:
        while True:
            state = yield rest.send(state)
    except StopIteration:
        return
