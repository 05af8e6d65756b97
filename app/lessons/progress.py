"""Lesson progress: how far a lesson has come, kept so that another page can go on with it."""

from dataclasses import dataclass, field

from app.lessons.lesson import Lesson


@dataclass(frozen=True)
class Ended:
    """The moment at which a step ended."""

    run_id: int
    moment: int


@dataclass(frozen=True)
class Findings:
    """Results of a step.

    Attributes:
        numbers: by expression.
        claims: with whether they hold.
        found: for each claim that does not hold, the values of its quantities, such as `off(0) = 12.2`.
    """

    numbers: dict[str, float]
    claims: tuple[tuple[str, bool], ...]
    found: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class LessonProgress:
    """Attributes:
    step: the current step.
    findings: by step.
    chosen: the answers given to questions, by step.
    measured, branches: of the check boxes, by step and what is switched off: the number and the end of the branch.
    kept: numbers for later steps, by name.
    runs: ids of the lesson's runs, by their names in it.
    ends: where the steps ended.
    """

    lesson: Lesson
    step: int
    findings: dict[int, Findings]
    chosen: dict[int, int]
    measured: dict[tuple[int, frozenset[int]], float]
    branches: dict[tuple[int, frozenset[int]], Ended]
    kept: dict[str, float]
    runs: dict[str, int]
    ends: dict[int, Ended]


@dataclass
class LastLesson:
    """What the pages of a session share: the progress of the lesson that was last open in any of them; None without one."""

    progress: LessonProgress | None = None
