"""Result facts: whether a finished run helped, as far as it can be told from photos, points and, where it is known, the truth."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from app.debugger.error_history import ErrorMeasure, knows_truth
from app.debugger.runs import RunInfo
from fairing.judge.comparable_residual import MeasuredResidual
from fairing.judge.metrics import HeldOutDistances, held_out_distances
from fairing.options import PRESETS
from fairing.run.recorded_refinement import RecordedRefinement
from fairing.scene import Scene

WORST = 5  # vertices listed
HELPED = 0.99
"""Times the residual of the start: below it the photos agree clearly better with the end."""


@dataclass(frozen=True, eq=False)
class ResultFacts:
    """The end of a run beside its start.

    Attributes:
        residual: before and after, grey levels.
        held_out: distances of the held-out sparse points, percent of the diagonal; None without such points on the surface.
        error: RMS distance to the truth before and after, percent of the diagonal; None where it is not known.
        left_out: of the report beside the record: PSNR before and after, dB, and number of photos; None if they were not measured.
        moved: (n,) float: displacement of each vertex, percent of the diagonal.
        worst: the vertices with the largest residual of the faces around them, and that residual, grey levels.
        corrections: (V,) float, px: of the cameras; None if they are the given ones.
        is_paper: whether the options are nearest to those of the preset `paper`.
    """

    residual: tuple[float, float]
    held_out: HeldOutDistances | None
    error: tuple[float, float] | None
    left_out: tuple[float, float, int] | None
    moved: np.ndarray
    worst: list[tuple[int, float]]
    corrections: np.ndarray | None
    is_paper: bool

    @property
    def helped(self) -> bool:
        """Whether the photos agree clearly better with the end than with the start."""
        return self.residual[1] < HELPED * self.residual[0]

    @property
    def objection(self) -> str:
        """What speaks against the end although the photos agree better with it, as a clause; empty if nothing does."""
        if self.error is not None and self.error[1] >= self.error[0]:
            return "the mesh is no nearer to the truth"
        if self.held_out is not None:
            before, after = (float(np.median(each.values)) for each in (self.held_out.before, self.held_out.after))
            if after > before / HELPED:
                return "held-out points lie farther from the surface"
        if self.left_out is not None and self.left_out[1] < self.left_out[0]:
            return "left-out photos are predicted worse"
        return ""


def result_facts(
    scene: Scene, run: RunInfo, before: MeasuredResidual, after: MeasuredResidual, report: Path | None
) -> ResultFacts:
    """Compute them; takes seconds on scenes with many sparse points.

    Args:
        run: at its end.
        before, after: residuals at its start and end.
        report: file that `fair` may have written about the run; None without a place for one.
    """
    start, end = run.trace.start, run.trace.vertices_at(run.length)
    held_out = held_out_distances(scene, start, end)
    by_vertex = np.nan_to_num(after.by_vertex(scene.mesh), nan=-1.0)
    order = np.argsort(-by_vertex)[:WORST].tolist()
    refinement = RecordedRefinement.of(scene, run.trace.header)
    error = None
    if knows_truth(scene):
        every, measure = np.arange(len(start)), ErrorMeasure(scene)
        off = [float(np.sqrt((measure.percent(every, each) ** 2).mean())) for each in (start, end)]
        error = off[0], off[1]
    return ResultFacts(
        residual=(before.mean, after.mean),
        held_out=held_out if held_out is not None and len(held_out.after.values) else None,
        error=error,
        left_out=_left_out(report),
        moved=100 * np.linalg.norm(end - start, axis=1) / scene.mesh.diagonal,
        worst=[(vertex, float(by_vertex[vertex])) for vertex in order if by_vertex[vertex] > 0],
        corrections=None if refinement is None else refinement.corrections,
        is_paper=run.options.step.solver == PRESETS["paper"].step.solver,
    )


def _left_out(report: Path | None) -> tuple[float, float, int] | None:
    """PSNR of left-out photos before and after, and their number, from a report; None if it does not tell."""
    if report is None:
        return None
    try:
        found: Any = json.loads(report.read_text(encoding="utf-8"))["left_out"]
        return float(found["psnr_before"]), float(found["psnr_after"]), int(found["photos_judged"])
    except (OSError, ValueError, KeyError, TypeError):
        return None
