"""Stage text: names of the stages of a run, and one line about where a step is in its stage."""

import numpy as np

from app.debugger.history import StageProgress
from app.plot_line import Line
from fairing.options import FairingOptions
from fairing.run.recorded_stages import RecordedStage
from fairing.stage_kind import StageKind
from fairing.trace import StepRecord


def stage_name(kind: StageKind, level: int, options: FairingOptions) -> str:
    """The name of a stage; photos have a stage for each blur."""
    return f"{kind.label} {blur_text(level, options)}" if kind is StageKind.PHOTOS else kind.label


def blur_text(level: int, options: FairingOptions) -> str:
    """The blur of the photos at a level, with its unit."""
    return f"{options.levels[level].blur:g} px"


def stage_hint(stage: RecordedStage, options: FairingOptions) -> str:
    """Name, level, number of steps and purpose of a stage."""
    count = stage.end - stage.begin
    level = f"level {stage.level + 1} of {options.n_levels}, blur {blur_text(stage.level, options)}"
    return f"{stage.kind.label.capitalize()}: {level}, {count} step{'s' if count > 1 else ''}. {stage.kind.text}"


def stage_line(record: StepRecord, progress: StageProgress, options: FairingOptions) -> str:
    """The stage of a step, and what the step is in it: "points · gate 3 of 20", "judge · 4 vertices go back"."""
    kind = record.stage
    name = stage_name(kind, record.position.level, options)
    if kind in (StageKind.MANUAL, StageKind.FIT, StageKind.SNAPSHOT):
        return name
    if kind is StageKind.JUDGE:
        count = int((record.before != record.after).any(axis=1).sum())
        what = {0: "nothing goes back", 1: "1 vertex goes back"}.get(count, f"{count} vertices go back")
        return f"{name} · {what}"
    has_sweeps = kind in (StageKind.PHOTOS, StageKind.POINTS) or max(progress.sweep, progress.n_sweeps or 1) > 1
    of_all = "" if progress.n_sweeps is None or kind is StageKind.PHOTOS else f" of {progress.n_sweeps}"
    parts = [f"{sweep_word(kind)} {progress.sweep}{of_all}"] if has_sweeps else []
    if kind is StageKind.PHOTOS or record.position.iteration > 0 or not has_sweeps:
        parts.append(f"iteration {record.position.iteration + 1}")
    return f"{name} · {', '.join(parts)}"


def sweep_word(kind: StageKind | None) -> str:
    """What a sweep of a stage is called: each of the fit to points narrows the gate beyond which points are left out."""
    return "gate" if kind is StageKind.POINTS else "sweep"


def fit_lines(steps: list[StepRecord], stages: list[RecordedStage]) -> list[Line]:
    """Of each stage of a fit the objective, percent of its value at the beginning of the stage.

    The objectives of two sweeps do not compare, since each has its own associations. What one sweep leaves of its objective
    multiplies with what the earlier ones have left.
    """
    lines = []
    for stage in stages:
        if stage.kind.is_fit:
            of_stage = steps[stage.begin : stage.end]
            left = [s.objective_after / s.objective_before if s.objective_before > 0 else 1.0 for s in of_stage]
            lines.append(Line(np.arange(stage.begin, stage.end + 1), 100 * np.cumprod([1.0, *left])))
    return lines
