"""Lesson: data classes of a parsed lesson."""

from dataclasses import dataclass
from functools import reduce

from app.debugger.condition import Condition
from app.lessons.engine_actions import Advance, Changes, EngineAction
from app.lessons.page_settings import PageSettings, SettingsChange

ANY_SCENE = "any"


@dataclass(frozen=True)
class Question:
    """Attributes:
    text: Markdown.
    choices: Markdown, one line each.
    right: index of the right choice.
    answer: Markdown, shown once a choice is made.
    """

    text: str
    choices: tuple[str, ...]
    right: int
    answer: str


@dataclass(frozen=True)
class Kept:
    """A number that later steps can use by its name."""

    name: str
    expression: Condition


@dataclass(frozen=True)
class Switches:
    """Check boxes, each of which switches a part of the engine off in a branch from the end of a step.

    Attributes:
        advance: how far the branches run.
        measure: the number that is compared at their ends.
        options: for each check box its label and the options that are changed while it is not checked.
    """

    advance: Advance
    measure: Condition
    options: tuple[tuple[str, Changes], ...]

    def changes_without(self, off: frozenset[int]) -> Changes:
        """The options that are changed while the check boxes with these indices are not checked."""
        return tuple(change for k in sorted(off) for change in self.options[k][1])


@dataclass(frozen=True)
class LessonStep:
    """Attributes:
    title: plain text.
    text: Markdown with formulas in $ or $$, and expressions over engine quantities in braces, such as {off(0)}.
    actions: of the engine, when the step is reached from the previous one.
    settings_changes: changes of the page settings, in effect from this step on.
    code: the lines of the algorithm to show, a key of `app.pictures.paper_code.LINES`; None for none.
    question: shown below the text.
    switches: check boxes below the text.
    keeps: numbers computed at the end of the step, for later steps.
    claims: conditions that hold at the end of the step.
    numbers: the expressions in braces of all texts, by their text.
    """

    title: str
    text: str
    actions: tuple[EngineAction, ...]
    settings_changes: tuple[SettingsChange, ...]
    code: str | None
    question: Question | None
    switches: Switches | None
    keeps: tuple[Kept, ...]
    claims: tuple[Condition, ...]
    numbers: dict[str, Condition]


@dataclass(frozen=True)
class Lesson:
    """Attributes:
    name: short and unique, the argument of --lesson.
    title: plain text.
    about: one sentence, plain text.
    scene: name of its demo scene (see `app.lessons.scenes`), or `ANY_SCENE`.
    steps: 6 to 12.
    """

    name: str
    title: str
    about: str
    scene: str
    steps: tuple[LessonStep, ...]

    def page_settings_at(self, step: int) -> PageSettings:
        """Page settings at a step: the changes of all steps up to it, applied in order."""
        changes = [change for earlier in self.steps[: step + 1] for change in earlier.settings_changes]
        return reduce(lambda settings, change: change(settings), changes, PageSettings())
