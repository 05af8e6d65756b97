"""What an experiment is: a list of cases, and what is measured of each."""

from collections.abc import Iterator, Sequence
from typing import Any, ClassVar, Protocol

from fairing.experiments.setting import Setting

Row = dict[str, Any]
"""A case's settings and, once it is measured, its results: numbers and names, and lists of numbers for curves."""


class Experiment(Protocol):
    """A frozen dataclass whose fields say how much is done; every case is a run of its own and knows nothing of others.

    Attributes:
        name: what the user types.
        title: what the user reads.
        question: the question it answers, one sentence.
        columns: of a row that has been measured: name and meaning with unit. Rows may hold curves besides.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    question: ClassVar[str]
    columns: ClassVar[dict[str, str]]

    def cases(self, setting: Setting) -> list[Row]:
        """The settings of all cases, those that show most first.

        Raises:
            InputError: the scene does not allow any.
        """
        ...

    def measure(self, setting: Setting, case: Row) -> Row:
        """The results of a case; the same for the same case, whatever was measured before."""
        ...

    def finding(self, rows: Sequence[Row]) -> str:
        """What the rows measured so far say, in a sentence or two; empty where they say nothing yet."""
        ...


def open_cases(experiment: Experiment, setting: Setting, done: Sequence[Row] = ()) -> list[Row]:
    """The cases that no row of `done` has measured, in their order."""
    return [
        case
        for case in experiment.cases(setting)
        if not any(all(row.get(name) == value for name, value in case.items()) for row in done)
    ]


def measured(experiment: Experiment, setting: Setting, case: Row) -> Row:
    """The whole row of a case."""
    return case | experiment.measure(setting, case)


def results(experiment: Experiment, setting: Setting, done: Sequence[Row] = ()) -> Iterator[Row]:
    """Measure one case after another.

    Args:
        done: rows of an earlier, interrupted call; their cases are not measured again.
    """
    for case in open_cases(experiment, setting, done):
        yield measured(experiment, setting, case)
