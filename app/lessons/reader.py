"""Lesson reader: parses lesson files.

A file begins with lines `name: value` between two lines `---` (title, about, scene). Every step begins with a heading
`# ...`. Text is Markdown with formulas in $ or $$ and expressions over engine quantities in braces. Fenced blocks are
directives:

    ```do       actions, see `vocabulary`
    ```code     the lines of the algorithm to show, see `app.pictures.paper_code`
    ```keep     name = expression: a number for later steps
    ```claim    conditions that hold when the actions of the step are done
    ```switch   a step and a number, then check boxes: lines `label: options while it is not checked`
    ```ask      a question, lines `- choice` (the right one ends with ` *`), then the answer
"""

import re
from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

from app.debugger.condition import Condition, parse_condition
from app.debugger.quantities import item_words
from app.lessons.engine_actions import Advance, EngineAction
from app.lessons.facts import FUNCTIONS, VALUES
from app.lessons.lesson import ANY_SCENE, Kept, Lesson, LessonStep, Question, Switches
from app.lessons.scenes import LESSON_SCENES
from app.lessons.vocabulary import Action, read_changes, understand_action
from app.pictures.paper_code import LINES
from fairing.errors import InputError
from fairing.util.plugins import offered

FEWEST_STEPS, MOST_STEPS = 6, 12
# The recommended order.
ORDER = (
    "model",
    "cells",
    "displacement",
    "robust",
    "coarse",
    "dimensions",
    "aperture",
    "beyond",
    "pulls",
    "cameras",
    "capture",
)
_HEAD = re.compile(r"---\n(.*?)\n---\n(.*)", re.DOTALL)
_BLOCK = re.compile(r"```(\w+)\n(.*?)\n```\n?", re.DOTALL)
_NUMBER = re.compile(r"\{([^{}]+)\}")
_FORMULA = re.compile(r"\$\$.*?\$\$|\$[^$]*\$", re.DOTALL)
_BLOCKS = {"do", "code", "keep", "claim", "ask", "switch"}


@cache
def lesson_names() -> tuple[str, ...]:
    """Names of all lessons: those of `ORDER`, then any others by name, also those of other packages.

    Another package offers the Markdown files of one of its packages by an entry point of the group `eigenfairing.lessons`.
    """
    found = _lesson_files()
    return (*(name for name in ORDER if name in found), *sorted(found.keys() - set(ORDER)))


@cache
def load_lesson(name: str) -> Lesson:
    """A lesson of this package, or of a file.

    Args:
        name: of the lesson; or the path of a Markdown file (.md), whose lesson is named after it.

    Raises:
        InputError: there is no such lesson, or its file is invalid.
    """
    if name.endswith(".md"):
        path = Path(name)
        try:
            return read_lesson(path.stem, path.read_text(encoding="utf-8"))
        except (OSError, UnicodeDecodeError) as error:
            raise InputError(f"lesson {name}: cannot be read ({error})") from None
    if name not in lesson_names():
        raise InputError(f"lesson {name:.40}: expected one of {', '.join(lesson_names())}, or a file ending in .md")
    return read_lesson(name, _lesson_files()[name].read_text(encoding="utf-8"))


def _lesson_files() -> dict[str, Traversable]:
    """The files of all lessons by name; those of this package win."""
    folders = [
        *(files(package) for package in offered("eigenfairing.lessons").values()),
        files("app.lessons") / "texts",
    ]
    return {
        file.name.removesuffix(".md"): file
        for folder in folders
        for file in folder.iterdir()
        if file.name.endswith(".md")
    }


def read_lesson(name: str, written: str) -> Lesson:
    """A lesson from the text of its file.

    Raises:
        InputError: the file is invalid; the message names lesson and step, what was expected and what was found.
    """
    found = _HEAD.fullmatch(written)
    if found is None:
        raise InputError(f"lesson {name}: expected lines `name: value` between two lines ---, then steps")
    head = dict(re.findall(r"(\w+): *(.+)", found[1]))
    if set(head) != {"title", "about", "scene"}:
        raise InputError(f"lesson {name}: expected title, about and scene at its head, found {', '.join(head)}")
    if head["scene"] not in (ANY_SCENE, *LESSON_SCENES):
        known = ", ".join((ANY_SCENE, *LESSON_SCENES))
        raise InputError(f"lesson {name}: scene: expected one of {known}; found {head['scene']}")
    before, *parts = re.split(r"^# +(.+)\n", found[2], flags=re.MULTILINE)
    titles, bodies = parts[::2], parts[1::2]
    if before.strip() or not FEWEST_STEPS <= len(titles) <= MOST_STEPS:
        raise InputError(f"lesson {name}: expected {FEWEST_STEPS} to {MOST_STEPS} steps, found {len(titles)}")
    steps, runs, kept = [], set(), set()
    for n, (title, body) in enumerate(zip(titles, bodies, strict=True), 1):
        try:
            steps.append(_step(title.strip(), body, runs, kept))
        except InputError as error:
            raise InputError(f"lesson {name}, step {n} ({title.strip()}): {error}") from None
    return Lesson(name, head["title"], head["about"], head["scene"], tuple(steps))


def _step(title: str, body: str, runs: set[str], kept: set[str]) -> LessonStep:
    blocks: dict[str, str] = {}
    for kind, content in _BLOCK.findall(body):
        if kind not in _BLOCKS or kind in blocks:
            raise InputError(f"expected one block each of {', '.join(sorted(_BLOCKS))}; found {kind}")
        blocks[kind] = content
    text = _BLOCK.sub("", body).strip()
    if not text or "```" in text:
        raise InputError("expected a text, and blocks that begin with ```kind and end with ``` on lines of their own")
    actions: list[Action] = [understand_action(line, runs) for line in _lines(blocks.get("do", ""))]
    code = blocks["code"].strip() if "code" in blocks else None
    if code is not None and code not in LINES:
        raise InputError(f"code: expected one of {', '.join(LINES)}; found {code}")
    question = _question(blocks["ask"]) if "ask" in blocks else None
    keeps = []
    for line in _lines(blocks.get("keep", "")):
        found = re.fullmatch(r"([a-z]\w*) = (.+)", line)
        if found is None or found[1] in VALUES or found[1] in FUNCTIONS:
            raise InputError(f"keep: expected `name = expression` with a name of its own, found {line!r:.60}")
        keeps.append(Kept(found[1], _expression(found[2], kept)))
    kept |= {keep.name for keep in keeps}
    claims = tuple(_expression(line, kept) for line in _lines(blocks.get("claim", "")))
    texts = [text, *((question.text, question.answer, *question.choices) if question else ())]
    numbers = {n: _expression(n, kept) for part in texts for n in numbers_in(part)}
    return LessonStep(
        title,
        text,
        tuple(action for action in actions if isinstance(action, EngineAction)),
        tuple(action for action in actions if not isinstance(action, EngineAction)),
        code,
        question,
        _switches(blocks["switch"], kept) if "switch" in blocks else None,
        tuple(keeps),
        claims,
        numbers,
    )


def numbers_in(text: str) -> list[str]:
    """The expressions in braces outside formulas."""
    return _NUMBER.findall(_FORMULA.sub("", text))


def _expression(text: str, kept: set[str]) -> Condition:
    return parse_condition(text, {*VALUES, *kept}, set(FUNCTIONS), items={"pull": "term"}, words=item_words())


def _question(written: str) -> Question:
    found = re.fullmatch(r"(.*?)\n((?:- [^\n]+\n)+)\n(.+)", written, re.DOTALL)
    if found is None:
        raise InputError("ask: expected a question, lines `- choice`, an empty line, then the answer")
    choices = [line[2:].strip() for line in found[2].splitlines()]
    right = [n for n, choice in enumerate(choices) if choice.endswith(" *")]
    if len(right) != 1 or len(choices) < 2:
        raise InputError(f"ask: expected one of several choices to end with ` *`, found {len(right)} of {len(choices)}")
    return Question(
        found[1].strip(), tuple(choice.removesuffix(" *") for choice in choices), right[0], found[3].strip()
    )


def _switches(written: str, kept: set[str]) -> Switches:
    first, *boxes = _lines(written)
    found = re.fullmatch(r"(step .+?): *(.+)", first)
    advance = understand_action(found[1], set()) if found else None
    if found is None or not isinstance(advance, Advance) or not boxes:
        raise InputError("switch: expected a line such as `step one sweep: off(4)`, then lines `label: options`")
    options = []
    for box in boxes:
        label, _, changes = box.partition(":")
        options.append((label.strip(), read_changes(changes)))
        if not options[-1][1]:
            raise InputError(f"switch: expected `label: options`, found {box!r:.60}")
    return Switches(advance, _expression(found[2], kept), tuple(options))


def _lines(block: str) -> list[str]:
    return [line.strip() for line in block.splitlines() if line.strip()]
