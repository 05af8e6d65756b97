"""Experiments in a notebook: measured in processes with a progress bar, displayed as charts."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.experiments.chart import charts_of
from app.experiments.workers import rows_in_order
from app.export.assets import offline_document
from app.html import number, text
from app.notebook.frame import Frame
from app.notebook.progress import progress
from app.panels.chart_svg import charts_svg
from fairing.errors import InputError
from fairing.experiments import Experiment, Row, Setting, experiments

HEIGHT = 560  # px


@dataclass(frozen=True)
class Measured:
    """Results of an experiment.

    Attributes:
        experiment: with its parameters.
        cases: the settings of all cases.
        rows: the measured ones, in the order of the cases; each a dictionary with the experiment's columns.
    """

    experiment: Experiment
    cases: tuple[Row, ...]
    rows: tuple[Row, ...]

    @property
    def finding(self) -> str:
        """The conclusion, one or two sentences."""
        return self.experiment.finding(self.rows)

    def column(self, name: str) -> list[Any]:
        """The values of a column, one for each row."""
        return [row[name] for row in self.rows]

    def frame(self, height: int = HEIGHT) -> Frame:
        """The charts, the finding and the table as a page."""
        return Frame(_page(self), f"{self.experiment.title}: {len(self.rows)} runs", height)

    def _repr_html_(self) -> str:
        return self.frame()._repr_html_()

    def __repr__(self) -> str:
        return f"<{self.experiment.title}: {len(self.rows)} runs. {self.finding}>"


def measure(experiment: Experiment, setting: Setting) -> Measured:
    """Measure all cases of an experiment in processes, with a progress bar.

    Raises:
        InputError: the scene allows no case, or a case cannot be measured.
    """
    cases = experiment.cases(setting)
    with progress(experiment.title) as bar:
        rows = rows_in_order(experiment, setting, cases, bar)
    return Measured(experiment, tuple(cases), tuple(rows))


def read_measured(path: Path) -> Measured:
    """The results in the record (.json) that `eigenfairing experiment` wrote.

    Raises:
        InputError: the file is not such a record.
    """
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        fields = {name: tuple(value) if isinstance(value, list) else value for name, value in found["fields"].items()}
        experiment = experiments()[found["experiment"]](**fields)
        rows = tuple(dict(row) for row in found["rows"])
        if not rows or not all(set(experiment.columns) <= set(row) for row in rows):
            raise ValueError
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        raise InputError(f"{path}: expected the record of an experiment with results, found something else") from None
    return Measured(experiment, rows, rows)


def _page(measured: Measured) -> str:
    names = measured.experiment.columns
    head = "".join(f"<th title='{text(meaning)}'>{text(name)}</th>" for name, meaning in names.items())
    rows = "".join(f"<tr>{''.join(f'<td>{_shown(row[name])}</td>' for name in names)}</tr>" for row in measured.rows)
    body = (
        f"<h1>{text(measured.experiment.title)}</h1><p>{text(measured.experiment.question)}</p>"
        f"<div class='charts'>{charts_svg(charts_of(measured.experiment, measured.cases, measured.rows))}</div>"
        f"<p><b>{text(measured.finding)}</b></p><details><summary>{len(measured.rows)} runs</summary>"
        f"<table><tr>{head}</tr>{rows}</table></details>"
    )
    return offline_document(measured.experiment.title, measured.experiment.question, _STYLE, body)


def _shown(value: Any) -> str:
    return number(value) if isinstance(value, float) else text(value)


_STYLE = """
:root { color-scheme: light dark; }
body { margin: 0; padding: 16px 20px; background: var(--ground); color: var(--text); font: 14px/1.5 system-ui, sans-serif;
  font-variant-numeric: tabular-nums; }
h1 { font-size: 18px; margin: 0; color: var(--strong); } h4 { margin: 8px 0 0; font-size: 13px; color: var(--strong); }
p { margin: 4px 0 8px; max-width: 70ch; } b { color: var(--strong); font-weight: 600; }
.charts { max-width: 520px; } svg { display: block; width: 100%; } svg text { fill: var(--dim); font-size: 10px; }
.row { display: flex; align-items: center; gap: 5px; } .chips { flex-wrap: wrap; column-gap: 12px; color: var(--dim); }
.swatch { width: 10px; height: 10px; border-radius: 3px; }
table { border-collapse: collapse; } td, th { padding: 2px 10px; text-align: right; } th { color: var(--dim); font-weight: 400; }
summary { cursor: pointer; }
"""
