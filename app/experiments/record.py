"""Experiment record: the files of an experiment: a table, a picture, and a JSON record from which it can be resumed."""

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from app.experiments.chart import charts_of
from app.experiments.picture import png_of
from app.files.json_file import write_json
from fairing.errors import InputError
from fairing.experiments import Experiment, Row, Setting
from fairing.io import write_atomically
from fairing.judge.report import versions
from fairing.options import FairingOptions, options_from_dict, options_to_dict


@dataclass(frozen=True, eq=False)
class Record:
    """An experiment with its cases.

    Attributes:
        experiment: with its parameters.
        setting: scene, vertex and options.
        scene: the scene as the user named it.
        cases: all cases, in their order.
    """

    experiment: Experiment
    setting: Setting
    scene: str
    cases: Sequence[Row]

    @property
    def stem(self) -> str:
        """The file name without suffix."""
        return self.experiment.name

    def in_order(self, rows: Sequence[Row]) -> list[Row]:
        """The rows in the order of the cases."""
        order = {_key(case): n for n, case in enumerate(self.cases)}
        names = list(self.cases[0])
        return sorted(rows, key=lambda row: order[_key({name: row[name] for name in names})])

    def csv(self, rows: Sequence[Row]) -> bytes:
        """The rows as CSV with a header line."""
        text = io.StringIO()
        table = csv.DictWriter(text, list(self.experiment.columns), extrasaction="ignore", lineterminator="\n")
        table.writeheader()
        table.writerows(self.in_order(rows))
        return text.getvalue().encode()

    def png(self, rows: Sequence[Row]) -> bytes:
        """The charts with the finding, as PNG."""
        title = f"{self.experiment.title}: {Path(self.scene).name}, vertex {self.setting.vertex}"
        charts = charts_of(self.experiment, self.cases, rows)
        return png_of(charts, title, self.experiment.finding(rows))

    def values(self, rows: Sequence[Row]) -> dict[str, Any]:
        """The record as JSON values: identity, versions and all rows, including curves."""
        return self.identity() | {
            "title": self.experiment.title,
            "question": self.experiment.question,
            "finding": self.experiment.finding(rows),
            "finished": len(rows) == len(self.cases),
            "edge": self.setting.edge,
            "columns": dict(self.experiment.columns),
            "versions": versions(),
            "cases": len(self.cases),
            "rows": self.in_order(rows),
        }

    def identity(self) -> dict[str, Any]:
        """The parameters that all rows have in common; the number of threads is not one of them."""
        return {
            "experiment": self.experiment.name,
            "scene": self.scene,
            "vertex": self.setting.vertex,
            "cameras": self.setting.scene.cameras_origin,
            "fields": _plain(asdict(self.experiment)),  # pyright: ignore[reportArgumentType]
            "options": _option_values(self.setting.options),
        }

    def save(self, folder: Path, rows: Sequence[Row], *, picture: bool) -> None:
        """Write the record and the table, and the picture if `picture` is set.

        Raises:
            InputError: a file cannot be written.
        """
        write_json(folder / f"{self.stem}.json", self.values(rows))
        write_atomically(folder / f"{self.stem}.csv", lambda file: file.write(self.csv(rows)))
        if picture and rows:
            write_atomically(folder / f"{self.stem}.png", lambda file: file.write(self.png(rows)))

    def earlier_rows(self, folder: Path) -> list[Row]:
        """The rows of an interrupted experiment in this folder; empty without a record.

        Raises:
            InputError: the record is damaged, or of another experiment, scene, vertex or options.
        """
        path = folder / f"{self.stem}.json"
        if not path.exists():
            return []
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
            rows = [dict(row) for row in found["rows"]]
            is_whole = all(set(self.experiment.columns) <= set(row) for row in rows)
            known = {_key(case) for case in self.cases}
            names = list(self.cases[0])
            found.setdefault("cameras", "given")  # as all were, before they could be refined
            wanted = self.identity()
            found["options"] = _option_values(options_from_dict(found["options"]))
            different = [name for name, value in wanted.items() if found.get(name) != value]
            if not different and not (is_whole and all(_key({n: r[n] for n in names}) in known for r in rows)):
                raise ValueError
        except (ValueError, KeyError, TypeError, OSError):
            raise InputError(
                f"{path}: expected the record of an experiment, found something else; omit --resume"
            ) from None
        if different:
            raise InputError(f"{path}: was made with a different {different[0]}; use the same, or another --out")
        return rows


def _key(case: Row) -> tuple[Any, ...]:
    return tuple(case.items())


def _option_values(options: FairingOptions) -> Any:
    """The options that decide results, as JSON values."""
    return _plain(options_to_dict(replace(options, threads=0)))


def _plain(values: Any) -> Any:
    """The values as read back from JSON: tuples become lists."""
    return json.loads(json.dumps(values))
