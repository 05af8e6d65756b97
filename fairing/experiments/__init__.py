"""Experiments on one displaced vertex of a scene with known truth: capture range, noise, dimensions, warps and solvers.

    setting = Setting.of(scene)
    for row in results(CaptureRange(), setting):
        print(row)

What belongs here: `Setting` (the vertex and its options), the `Experiment` protocol, and one file per experiment.

May import: every other part of `fairing`.

Offers: `experiments` by name, `Setting`, `results`, `check_truth`.
"""

from fairing.experiments.capture_range import CaptureRange
from fairing.experiments.experiment import Experiment, Row, results
from fairing.experiments.k_sweep import KSweep
from fairing.experiments.noise import NoiseAgainstBound
from fairing.experiments.setting import Setting, check_truth
from fairing.experiments.warps import WarpComparison
from fairing.util.plugins import offered

EXPERIMENTS: dict[str, type[Experiment]] = {
    experiment.name: experiment for experiment in (CaptureRange, NoiseAgainstBound, KSweep, WarpComparison)
}


def experiments() -> dict[str, type[Experiment]]:
    """All experiments by name: `EXPERIMENTS`, and those of other packages, entry points of the group `fairing.experiments`.

    Raises:
        InputError: one of them cannot be loaded.
    """
    return EXPERIMENTS | {kind.name: kind for kind in offered("fairing.experiments").values()}


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
    "experiments",
    "results",
]
