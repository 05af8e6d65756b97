"""Experiments on one displaced vertex of a scene with known truth: capture range, noise, dimensions, warps and solvers.

    setting = Setting.of(scene)
    for row in results(CaptureRange(), setting):
        print(row)

What belongs here: `Setting` (the vertex and its options), the `Experiment` protocol, and one file per experiment.

May import: every other part of `fairing`.

Offers: `EXPERIMENTS` by name, `Setting`, `results`, `check_truth`.
"""

from fairing.experiments.capture_range import CaptureRange
from fairing.experiments.experiment import Experiment, Row, results
from fairing.experiments.k_sweep import KSweep
from fairing.experiments.noise import NoiseAgainstBound
from fairing.experiments.setting import Setting, check_truth
from fairing.experiments.warps import WarpComparison

EXPERIMENTS: dict[str, type[Experiment]] = {
    experiment.name: experiment for experiment in (CaptureRange, NoiseAgainstBound, KSweep, WarpComparison)
}

__all__ = [
    "EXPERIMENTS",
    "CaptureRange",
    "Experiment",
    "KSweep",
    "NoiseAgainstBound",
    "Row",
    "Setting",
    "WarpComparison",
    "check_truth",
    "results",
]
