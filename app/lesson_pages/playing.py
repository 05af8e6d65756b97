"""Playing a lesson without a page: the runs, and the moment, numbers and verified claims of each step."""

import threading
from collections.abc import Callable
from dataclasses import dataclass

from app.debugger.controller import Controller
from app.export.run_facts import RunFacts
from app.lessons.lesson import Lesson
from app.lessons.page_settings import PageSettings
from app.lessons.player import Player, Status
from app.lessons.progress import Findings
from fairing.errors import InputError
from fairing.options import PRESETS
from fairing.run.session import Session
from fairing.scene import Scene
from fairing.trace import Trace

UNNAMED = "run"  # the run of a lesson that starts none
_POLL = 0.2  # s between two looks at the player, so that Ctrl-C is noticed


@dataclass(frozen=True)
class PlayedStep:
    """A step of a lesson at its end.

    Attributes:
        run: index of its run.
        moment: of that run.
        findings: its numbers and claims; all claims hold.
        settings: of the page.
        compared: index of the run that it is compared with, and the moment of that run; None without a comparison.
    """

    run: int
    moment: int
    findings: Findings
    settings: PageSettings
    compared: tuple[int, int] | None


@dataclass(frozen=True)
class PlayedRun:
    """A run of a lesson.

    Attributes:
        name: in the lesson.
        facts: its record.
    """

    name: str
    facts: RunFacts


@dataclass(frozen=True)
class PlayedLesson:
    """A lesson, the runs that its steps show, and its steps."""

    lesson: Lesson
    scene: Scene
    runs: tuple[PlayedRun, ...]
    steps: tuple[PlayedStep, ...]


def play_lesson(lesson: Lesson, scene: Scene, on_progress: Callable[[float], None]) -> PlayedLesson:
    """Run the engine through all steps of a lesson.

    Args:
        on_progress: called with the fraction of the steps that is done.

    Raises:
        InputError: the scene is not that of the lesson, a step fails, or a claim does not hold.
    """
    changed = threading.Event()
    controller = Controller(Session(scene, PRESETS["accurate"]))
    player = Player(controller, changed.set)
    steps: list[tuple[int, int, Findings, PageSettings, tuple[int, int] | None]] = []
    traces, names = dict[int, Trace](), dict[int, str]()
    try:
        player.open(lesson)
        for n in range(len(lesson.steps)):
            if n:
                player.next()
            while player.status is Status.AT_WORK:
                changed.wait(_POLL)
                changed.clear()
            steps.append(_ended_step(player, controller, lesson, n))
            traces |= {
                run.run_id: run.trace for run in controller.state.runs
            }  # a run without steps is replaced by the next
            names |= {run_id: name for name, run_id in player.run_names.items()}
            on_progress((n + 1) / len(lesson.steps))
    finally:
        controller.close()
    ids = list(dict.fromkeys([run_id for run_id, *_ in steps] + [step[4][0] for step in steps if step[4] is not None]))
    runs = _runs_of(scene, [(names.get(run_id, UNNAMED), traces[run_id]) for run_id in ids])
    number = {run_id: n for n, run_id in enumerate(ids)}
    played = [
        PlayedStep(number[run_id], moment, found, settings, None if other is None else (number[other[0]], other[1]))
        for run_id, moment, found, settings, other in steps
    ]
    return PlayedLesson(lesson, scene, runs, tuple(played))


def _ended_step(
    player: Player, controller: Controller, lesson: Lesson, n: int
) -> tuple[int, int, Findings, PageSettings, tuple[int, int] | None]:
    """Run id, moment, findings, settings, and run id and moment of the comparison."""
    end, where = player.end_of(n), f"lesson {lesson.name}, step {n + 1} ({lesson.steps[n].title})"
    if player.status is not Status.THERE or end is None or n not in player.findings:
        raise InputError(f"{where}: {player.problem or 'was interrupted'}")
    found = player.findings[n]
    untrue = [claim for claim, holds in found.claims if not holds]
    if untrue:
        raise InputError(f"{where}: expected {untrue[0]}, found {found.found[untrue[0]]}")
    settings = lesson.page_settings_at(n)
    reference = player.reference(settings)
    moments = {run.run_id: run.moment for run in controller.state.runs}
    other = None if reference is None else (reference.run_id, moments[reference.run_id])
    return end.run_id, end.moment, found, settings, other


def _runs_of(scene: Scene, found: list[tuple[str, Trace]]) -> tuple[PlayedRun, ...]:
    first: Session | None = None
    runs = []
    for name, trace in found:
        session = Session(scene, trace=trace, like=first)
        first = first or session
        runs.append(PlayedRun(name, RunFacts(session)))
    return tuple(runs)
