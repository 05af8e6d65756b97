"""The page for teachers: its table covers all lessons, and its exercises have the solutions that it prints."""

import contextlib
import io
import re
import textwrap
from pathlib import Path

import pytest

import app.lessons
from app.lessons import facts, vocabulary
from app.lessons.reader import lesson_names, load_lesson
from app.lessons.vocabulary import understand_action
from app.pictures.paper_code import LINES

PAGE = (Path(app.lessons.__file__).parent / "for_teachers.md").read_text(encoding="utf-8")
EXERCISES = re.findall(r"### (\d+\. [^\n]+)\n.*?```python\n(.*?)```\n\n```text\n(.*?)```", PAGE, re.DOTALL)
WORDS_PER_MINUTE, MINUTES_PER_STEP = 220, 1 / 3
NUMBER = re.compile(r"-?\d+(?:\.\d+)?")


def minutes_of(name: str) -> float:
    """Minutes for reading a lesson and looking at each of its steps."""
    words = 0
    for step in load_lesson(name).steps:
        question = step.question
        texts = [step.text, *((question.text, question.answer, *question.choices) if question else ())]
        words += sum(len(text.split()) for text in texts)
    return words / WORDS_PER_MINUTE + MINUTES_PER_STEP * len(load_lesson(name).steps)


def test_the_table_lists_every_lesson_with_its_time():
    rows = re.findall(r"^\| `(\w+)` \| [^|]+ \| (\d+) \| ([^|]+) \|$", PAGE, re.MULTILINE)
    assert tuple(name for name, _, _ in rows) == lesson_names()
    for name, minutes, questions in rows:
        assert int(minutes) == round(minutes_of(name)), name
        assert questions.strip().endswith("?")


def test_every_lesson_has_an_exercise():
    after = set(re.findall(r"\(after `(\w+)`\)", " ".join(title for title, _, _ in EXERCISES)))
    assert after | {"model"} == set(lesson_names())


def test_every_action_of_the_table_is_understood_and_every_kind_of_action_is_listed():
    rows = [row.split("|")[1] for row in part_of("Actions").splitlines() if row.startswith("| `")]
    actions = [action for row in rows for action in re.findall(r"`([^`]+)`", row)]
    assert len(actions) > 30
    for action in actions:
        understand_action(action, {"main", "a"})
    kinds = {re.findall(r"\w+", pattern)[0] for pattern, _ in vocabulary._ACTIONS}
    assert {line.split()[0] for line in actions} >= kinds


def part_of(heading: str) -> str:
    """The text under a heading of the page, up to the next one."""
    return re.split(r"^#+ .+\n", PAGE.partition(f"# {heading}\n")[2], maxsplit=1, flags=re.MULTILINE)[0]


def test_the_numbers_of_the_tables_exist_and_all_those_of_lessons_are_listed():
    listed = re.findall(r"`([a-z_]+)(\([vk]\))?`", part_of("Numbers"))
    assert {name for name, argument in listed if argument} <= set(facts.FUNCTIONS)
    values = {name for name, argument in listed if not argument} - {"and", "or", "not"}
    assert values <= set(facts.VALUES)
    assert values >= set(facts.OF_MOMENT)
    assert {name for name, _ in listed} >= set(facts.OF_ONE)


def test_the_names_of_lines_of_the_algorithm_are_listed():
    text = PAGE.partition("the algorithm of the paper in NumPy:")[2].partition("- `keep`")[0]
    assert re.findall(r"`(\w+)`", text) == list(LINES)


@pytest.mark.parametrize("name", LINES)
def test_lines_of_the_algorithm_are_whole_and_stand_in_a_function_with_their_equations(name):
    lines = LINES[name]
    # A complete block of statements, as the body of a loop in a function.
    compile("def f():\n for _ in ():\n" + textwrap.indent("\n".join(lines.lines), "  "), name, "exec")
    for number in lines.equations:
        assert re.search(rf"Eq\. {number}\b", lines.function.__doc__ or ""), lines.title


@pytest.mark.slow
@pytest.mark.parametrize(("title", "solution", "printed"), EXERCISES, ids=[title for title, _, _ in EXERCISES])
def test_the_solution_of_an_exercise_prints_what_is_shown(title, solution, printed):
    """Words are equal; numbers agree to 2 %, or to one unit of their last digit: machines differ in the last bits."""
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        exec(compile(solution, title, "exec"), {"__name__": "exercise"})
    assert NUMBER.sub("#", out.getvalue()).split() == NUMBER.sub("#", printed).split()
    for found, wanted in zip(NUMBER.findall(out.getvalue()), NUMBER.findall(printed), strict=True):
        unit = 10.0 ** -len(wanted.partition(".")[2])
        assert float(found) == pytest.approx(float(wanted), rel=0.02, abs=1.01 * unit)
