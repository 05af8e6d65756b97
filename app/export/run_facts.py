"""A recorded run and what all exports say about it: energies, errors, and which moments tell most."""

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from app.debugger.history import EnergyHistory
from app.debugger.runs import run_title
from app.files.run_files import REPORT
from app.stage import Stage
from fairing.errors import InputError
from fairing.judge.metrics import determined_part, quality_report
from fairing.judge.report import run_report
from fairing.run.session import Session
from fairing.solve.energy import Evaluator

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
    """Args:
    session: the run.
    folder: where `fair` wrote it; its report.json, if there is one, is believed.
    """

    def __init__(self, session: Session, folder: Path) -> None:
        self.session, self.folder = session, folder
        self.scene, self.trace, self.options = session.scene, session.trace, session.options
        self.length = len(session.trace)
        self.stage = Stage.of(session.scene)

    @cached_property
    def energies(self) -> EnergyHistory:
        history = EnergyHistory(len(self.trace.faces))
        history.update(_Record(self.trace, self.length))
        return history

    def energy_at(self, moment: int) -> float:
        """Of the whole mesh, under the cells of the sweep that led there; not a number in a record without steps."""
        if self.length == 0:
            return float("nan")
        return float(self.energies.after[moment - 1] if moment else self.energies.before[0])

    def fine_energy(self, moment: int) -> float:
        """Under the cells of the last sweep, so that moments compare."""
        sweep = self.session.sweep_state(self.length)
        faces = np.arange(len(self.trace.faces))
        vertices = self.trace.vertices_at(moment)
        found = Evaluator(self.options.threads).measure(sweep.context, vertices, faces, sweep.scale)
        return float(found.energy.sum())

    @cached_property
    def errors(self) -> np.ndarray | None:
        """(moments,) float: rms distance of the vertices to the truth, as far as photos can determine it, percent of the
        diagonal; None where the truth is not known."""
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
        """(moments,) float from 0 to 1, growing: half by the steps, half by how far the vertices went in them."""
        if self.length == 0:
            return np.zeros(1)
        travelled = [np.sqrt(((record.after - record.before) ** 2).sum()) for record in self.trace.steps]
        parts = [np.cumsum([0.0, *steps]) for steps in (np.ones(self.length), travelled)]
        parts = [part / part[-1] if part[-1] > 0 else parts[0] / parts[0][-1] for part in parts]
        return (parts[0] + parts[1]) / 2

    def key_moments(self, count: int) -> list[int]:
        """At most so many moments, start and end among them, evenly spread by `pace`."""
        wanted = np.linspace(0, 1, count)
        return sorted({0, self.length, *np.abs(self.pace[:, None] - wanted).argmin(axis=0).tolist()})

    @property
    def title(self) -> str:
        """The options in a few words."""
        return run_title(self.options)

    @cached_property
    def report(self) -> dict[str, Any]:
        """What report.json says; where there is none, the same without times.

        Raises:
            InputError: it is damaged.
        """
        path = self.folder / REPORT
        if not path.exists():
            quality = quality_report(self.scene, self.trace.start, self.trace.vertices_at(self.length))
            return run_report(self.session, self.title, {}, quality)
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
        except ValueError as error:
            raise InputError(f"{path}: expected the report of a run, found broken JSON ({error})") from None
        if not isinstance(found, dict) or found.get("format") != REPORT_FORMAT or not found.keys() >= _NEEDED:
            raise InputError(f"{path}: expected the report of a run ({REPORT_FORMAT}); remove it to do without")
        return found
