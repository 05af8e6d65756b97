"""Experiments of a lesson page, measured when the page is made."""

from collections.abc import Callable
from typing import Any

from app.experiments.chart import charts_of
from app.experiments.workers import rows_in_order
from app.html import text
from app.lessons.lesson import Lesson
from app.panels.chart_svg import charts_svg
from fairing.experiments import CaptureRange, Experiment, KSweep, NoiseAgainstBound, Setting, WarpComparison
from fairing.experiments.setting import check_truth
from fairing.options import PRESETS
from fairing.scene import Scene

# Fewer cases than the debugger measures, so that a page is made within a minute (ledger: experiments of lesson pages).
OF_PAGES: dict[str, Experiment] = {
    experiment.name: experiment
    for experiment in (
        CaptureRange(directions=2),
        NoiseAgainstBound(draws=2),
        KSweep(directions=1),
        WarpComparison(starts=(20.0,), directions=1),
    )
}


def experiment_of(lesson: Lesson) -> tuple[str, int] | None:
    """Name of the experiment that a lesson offers, and the vertex it displaces; None without an experiment."""
    last = lesson.page_settings_at(len(lesson.steps) - 1)
    name = last.settings.get("experiment")
    if name is None or not last.vertices:
        return None
    return str(name), last.vertices[-1]


def measured_experiment(name: str, vertex: int, scene: Scene, on_progress: Callable[[float], None]) -> dict[str, Any]:
    """Name, title, question, and markup of the charts and the finding of an experiment.

    Raises:
        InputError: the scene has no truth, or a case cannot be measured.
    """
    check_truth(scene)
    experiment = OF_PAGES[name]
    setting = Setting.of(scene, PRESETS["accurate"], vertex)
    cases = experiment.cases(setting)
    rows = rows_in_order(experiment, setting, cases, on_progress)
    return {
        "name": name,
        "title": experiment.title,
        "question": experiment.question,
        "charts": charts_svg(charts_of(experiment, cases, rows)),
        "finding": text(experiment.finding(rows)),
        "runs": len(rows),
    }
