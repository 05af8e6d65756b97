"""What a lesson is, once it is read."""

from dataclasses import dataclass
from functools import reduce

from app.debugger.condition import Condition
from app.lessons.engine_actions import EngineAction
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
    """A number that later steps may speak of by its name."""

    name: str
    expression: Condition


@dataclass(frozen=True)
class LessonStep:
    """Attributes:
    title: plain text.
    text: Markdown with formulas in $ or $$ and numbers of the engine in braces, such as {off(0)}.
    actions: what the engine does when the step is reached from the one before.
    settings_changes: what the page shows from this step on.
    code: the line of pseudo-code at work, a key of `pseudo_code.LINES`; None for none.
    question: asked below the text.
    keeps: numbers named at the end of the step.
    claims: what holds at the end of the step.
    numbers: the expressions in the braces of all texts, by their text.
    """

    title: str
    text: str
    actions: tuple[EngineAction, ...]
    settings_changes: tuple[SettingsChange, ...]
    code: str | None
    question: Question | None
    keeps: tuple[Kept, ...]
    claims: tuple[Condition, ...]
    numbers: dict[str, Condition]


@dataclass(frozen=True)
class Lesson:
    """Attributes:
    name: short and unique, as typed after --lesson.
    title: plain text.
    about: one sentence, plain text.
    scene: the name of the demo scene it plays on (see `app.lessons.scenes`), or `ANY_SCENE`.
    steps: 6 to 12.
    """

    name: str
    title: str
    about: str
    scene: str
    steps: tuple[LessonStep, ...]

    def page_settings_at(self, step: int) -> PageSettings:
        """What the page shows at a step: what all steps so far have asked for."""
        changes = [change for earlier in self.steps[: step + 1] for change in earlier.settings_changes]
        return reduce(lambda settings, change: change(settings), changes, PageSettings())
