"""The ledger of measurements: rows are short, what they name is in the code, and rows that the code refers to exist."""

import pkgutil
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from tests.ablation import SETTINGS

ROOT = Path(__file__).parent.parent
LEDGER = ROOT / "tests" / "ledger.md"
MOST_WORDS = 60
CHOICE = ["name", "in the code", "choice", "alternatives", "measured on"]  # header of a table of choices
NOT_IN_THE_CODE = ("-", "not in the code")


class Row(NamedTuple):
    """A row; `header` is the first row of its table."""

    header: list[str]
    cells: list[str]


def rows() -> Iterator[Row]:
    """The rows below the headers of all tables."""
    header: list[str] | None = None
    for line in LEDGER.read_text().splitlines():
        if not line.startswith("|"):
            header = None
            continue
        cells = [cell.strip() for cell in line.strip().removeprefix("|").removesuffix("|").split("|")]
        if header is None:
            header = cells
        elif not set(line) <= set("|-"):
            yield Row(header, cells)


CHOICES = [row.cells for row in rows() if row.header == CHOICE]
ABLATIONS = [row.cells for row in rows() if row.header[0] == "option or constant"]


def named(text: str) -> list[str]:
    """What stands between backticks."""
    return re.findall(r"`([^`]+)`", text)


def exists(name: str) -> bool:
    """Whether there is a file of the repository, or a name such as "run.stages.Judge", of `fairing` unless it says otherwise."""
    if "/" in name:
        return (ROOT / name).exists()
    try:
        pkgutil.resolve_name(name if name.split(".")[0] in ("app", "demo_scenes", "tests") else f"fairing.{name}")
    except (ImportError, AttributeError):
        return False
    return True


def references() -> Iterator[tuple[str, str]]:
    """(file, name) for each "(ledger: name)" in the code."""
    for folder in ("fairing", "app", "demo_scenes", "tests"):
        for path in sorted((ROOT / folder).rglob("*.py")):
            if path == Path(__file__):
                continue
            text = re.sub(r"\s*\n\s*(# )?", " ", path.read_text())  # comments and docstrings continue on the next line
            for name in re.findall(r"\(ledger: ([^)]+)\)", text):
                yield str(path.relative_to(ROOT)), name


def test_every_row_belongs_to_a_table_of_choices_or_of_settings():
    assert len(CHOICES) + len(ABLATIONS) == len(list(rows()))
    assert len(CHOICES) > 100
    assert len(ABLATIONS) > 20


def test_no_row_is_long():
    words = {row.cells[0]: len(" ".join(row.cells).split()) for row in rows()}
    assert {name: count for name, count in words.items() if count > MOST_WORDS} == {}


def test_every_row_has_all_cells_and_every_choice_a_name_of_its_own():
    assert [row.cells[0] for row in rows() if len(row.cells) != len(row.header)] == []
    names = [cells[0] for cells in CHOICES]
    assert sorted(names) == sorted(set(names))


def test_what_a_row_names_is_in_the_code():
    assert [cells[0] for cells in CHOICES if not named(cells[1]) and cells[1] not in NOT_IN_THE_CODE] == []
    assert [(cells[0], name) for cells in CHOICES for name in named(cells[1]) if not exists(name)] == []


def test_names_that_are_not_in_the_code_are_found_out():
    assert exists("run.stages.ROUNDS")
    assert not exists("run.stages.ROUNDS_BEFORE_GATES")
    assert not exists("run.no_such_module")
    assert not exists("app/page/no_such_file.js")


def test_rows_of_settings_are_of_the_ablation():
    settings = {setting.name.removeprefix("fairing.") for setting in SETTINGS}
    assert [cells[0] for cells in ABLATIONS if not set(named(cells[0])) <= settings] == []


def test_rows_that_the_code_refers_to_are_there():
    """Names may contain commas; several in one reference are separated by commas, too."""

    def is_row(text: str) -> bool:
        return any(cells[0].startswith(text) for cells in CHOICES)

    found = list(references())
    assert len(found) > 50
    assert [each for each in found if not (is_row(each[1]) or all(map(is_row, each[1].split(", "))))] == []
