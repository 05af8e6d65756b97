"""Experiment protocol: a list of cases, and a measurement of each."""

from collections.abc import Iterator, Sequence
from typing import Any, ClassVar, Protocol

from fairing.experiments.setting import Setting

Row = dict[str, Any]
"""The settings of a case and, once it is measured, its results: numbers and names, and lists of numbers for curves."""


class Experiment(Protocol):
    """A frozen dataclass whose fields set the number of cases; every case is an independent run.

    Attributes:
        name: on the command line.
        title: in headings.
        question: the question that the experiment answers, one sentence.
        columns: name of each column of a measured row, and its meaning with unit. Rows may also hold curves.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    question: ClassVar[str]
    columns: ClassVar[dict[str, str]]

    def cases(self, setting: Setting) -> list[Row]:
        """The settings of all cases, the most informative first.

        Raises:
            InputError: the scene allows no case.
        """
        ...

    def measure(self, setting: Setting, case: Row) -> Row:
        """The results of a case; they depend on the case only."""
        ...

    def finding(self, rows: Sequence[Row]) -> str:
        """Conclusion from the rows measured so far, one or two sentences; empty if they do not suffice."""
        ...


def open_cases(experiment: Experiment, setting: Setting, done: Sequence[Row] = ()) -> list[Row]:
    """The cases that are not among the rows `done`, in their order."""
    return [
        case
        for case in experiment.cases(setting)
        if not any(all(row.get(name) == value for name, value in case.items()) for row in done)
    ]


def measured(experiment: Experiment, setting: Setting, case: Row) -> Row:
    """Measure a case; returns its complete row."""
    return case | experiment.measure(setting, case)


def results(experiment: Experiment, setting: Setting, done: Sequence[Row] = ()) -> Iterator[Row]:
    """Measure one case after another.

    Args:
        done: rows of an earlier, interrupted call; their cases are skipped.
    """
    for case in open_cases(experiment, setting, done):
        yield measured(experiment, setting, case)
