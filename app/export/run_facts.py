"""Facts about a recorded run shared by all exports: energies, errors and key moments."""

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from app.debugger.history import EnergyHistory
from app.debugger.runs import run_title
from app.files.run_files import REPORT
from app.plot_line import Line
from app.stage import Stage
from fairing.errors import InputError
from fairing.judge.comparable_residual import ComparableResidual, MeasuredResidual
from fairing.judge.metrics import determined_part, quality_report
from fairing.judge.report import run_report
from fairing.run.session import Session

RESIDUALS = 40
"""Moments at which exports show the residual, besides the ends of stages."""
REPORT_FORMAT = "eigenfairing report 1"
_NEEDED = {
    "stop_reason",
    "finished",
    "scene",
    "sweeps",
    "vertices",
    "skipped",
    "warnings",
    "versions",
    "seconds",
    "samples",
}


@dataclass(frozen=True, eq=False)
class _Record:
    trace: Any
    length: int
    run_id: int = 0


class RunFacts:
    """Facts about a run, computed on first use.

    Args:
        session: the run.
        folder: the folder that `fair` wrote; figures are taken from its report.json if that exists.
    """

    def __init__(self, session: Session, folder: Path | None = None) -> None:
        self.session, self.folder = session, folder
        self.scene, self.trace, self.options = session.scene, session.trace, session.options
        self.length = len(session.trace)
        self.stage = Stage.of(session.scene)
        self._residuals: dict[int, MeasuredResidual] = {}

    @cached_property
    def energies(self) -> EnergyHistory:
        history = EnergyHistory(len(self.trace.faces))
        history.update(_Record(self.trace, self.length))
        return history

    def energy_at(self, moment: int) -> float:
        """Energy of the whole mesh with the cells of the sweep that led to the moment; NaN where none was measured."""
        if not self.energies.is_measured:
            return float("nan")
        return float(self.energies.after[moment - 1] if moment else self.energies.before[0])

    def residual(self, moment: int) -> MeasuredResidual:
        """The residuals at a moment, which compare with those of all other moments and runs."""
        if moment not in self._residuals:
            self._residuals[moment] = self._measure.measure(self.trace.vertices_at(moment))
        return self._residuals[moment]

    @cached_property
    def _measure(self) -> ComparableResidual:
        return ComparableResidual(self.session, threads=self.options.threads)

    @cached_property
    def residual_line(self) -> Line:
        """The comparable residual, grey levels, at the ends of the stages and at moments between them."""
        ends = [stage.end for stage in self.energies.stages(self.length)]
        moments = sorted({*ends, *self.key_moments(RESIDUALS)})
        line = Line(np.array(moments), np.array([self.residual(moment).mean for moment in moments]))
        known = np.isfinite(line.values)
        return Line(line.moments[known], line.values[known])

    @cached_property
    def energy_lines(self) -> list[Line]:
        """The energies of each sweep; energies of different sweeps are not comparable. Empty where none was measured."""
        return self.energies.lines(self.length)

    @cached_property
    def errors(self) -> np.ndarray | None:
        """(moments,) float: RMS distance of the vertices to the truth along directions the photos determine, percent of
        the diagonal; None if the truth is unknown."""
        truth = self.scene.truth
        if truth is None or truth.vertices is None:
            return None
        errors = []
        for moment in range(self.length + 1):
            off = determined_part(self.scene, self.trace.vertices_at(moment) - truth.vertices)
            errors.append(100 * np.sqrt((off**2).sum(axis=1).mean()) / self.scene.mesh.diagonal)
        return np.array(errors)

    @cached_property
    def pace(self) -> np.ndarray:
        """(moments,) float, increasing from 0 to 1: half by the number of steps, half by the vertices' displacements."""
        if self.length == 0:
            return np.zeros(1)
        travelled = [np.sqrt(((record.after - record.before) ** 2).sum()) for record in self.trace.steps]
        parts = [np.cumsum([0.0, *steps]) for steps in (np.ones(self.length), travelled)]
        parts = [part / part[-1] if part[-1] > 0 else parts[0] / parts[0][-1] for part in parts]
        return (parts[0] + parts[1]) / 2

    def key_moments(self, count: int) -> list[int]:
        """At most `count` (>= 2) moments, including start and end, evenly spaced by `pace`."""
        wanted = np.linspace(0, 1, count)
        return sorted({0, self.length, *np.abs(self.pace[:, None] - wanted).argmin(axis=0).tolist()})

    @property
    def title(self) -> str:
        """The options in a few words."""
        return run_title(self.options)

    @cached_property
    def report(self) -> dict[str, Any]:
        """Contents of report.json; if there is none, the same figures without times.

        Raises:
            InputError: report.json is damaged.
        """
        path = None if self.folder is None else self.folder / REPORT
        if path is None or not path.exists():
            quality = quality_report(self.scene, self.trace.start, self.trace.vertices_at(self.length))
            line = self.residual_line
            residuals = dict(zip(line.moments.tolist(), line.values.tolist(), strict=True))
            return run_report(self.session, self.title, {}, quality, residuals)
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
        except ValueError as error:
            raise InputError(f"{path}: expected the report of a run, found broken JSON ({error})") from None
        if not isinstance(found, dict) or found.get("format") != REPORT_FORMAT or not found.keys() >= _NEEDED:
            raise InputError(
                f"{path}: expected the report of a run ({REPORT_FORMAT}); remove it to export without its times"
            )
        return found
