"""Judge of corrected cameras: points that no adjustment used, triangulated with the given and with the corrected cameras."""

from dataclasses import dataclass

import numpy as np

from fairing.cameras.adjustment import residual_lengths, triangulate
from fairing.cameras.estimation import loss_at
from fairing.cameras.observed_points import ObservedPoints
from fairing.cameras.pose_model import PoseModel

HELD_OUT = 4
"""One of so many points is held out."""
FEWEST_POINTS = 40  # held out
LEAST_GAIN = 0.05
"""Of the mean loss of the held-out points: smaller improvements are not clear."""
LEAST_SIGNIFICANCE = 5.0
"""Improvement divided by its standard error, both over held-out points."""
STEPS = 10


@dataclass(frozen=True)
class CameraJudgement:
    """Held-out points with two sets of cameras: given ones (before) and corrected ones (after).

    Attributes:
        points: number of held-out points.
        error_before, error_after: median reprojection error, px.
        loss_before, loss_after: mean robust loss of a point, px^2.
        significance: decrease of the mean loss divided by its standard error.
        observation_sigma: px: estimated standard deviation of a coordinate of an observation, which scales the loss.
    """

    points: int
    error_before: float
    error_after: float
    loss_before: float
    loss_after: float
    significance: float
    observation_sigma: float

    @property
    def is_clear(self) -> bool:
        """Whether the corrected cameras are clearly better."""
        return (
            self.points >= FEWEST_POINTS
            and self.loss_after <= (1 - LEAST_GAIN) * self.loss_before
            and self.significance >= LEAST_SIGNIFICANCE
        )


def is_held_out(count: int) -> np.ndarray:
    """(count,) bool: the points that only judge."""
    return np.arange(count) % HELD_OUT == 0


def judge_cameras(
    model: PoseModel, before: np.ndarray, after: np.ndarray, held_out: ObservedPoints, noise: float
) -> CameraJudgement:
    """Compare two sets of cameras by points that neither was adjusted to.

    Args:
        before, after: (v, n) float, px: parameters, see `pose_model`.
        held_out: found with the given cameras, so that the choice of points does not favour the corrected ones.
        noise: standard deviation of a coordinate of an observation, px.
    """
    loss, lengths, losses = loss_at(noise), [], []
    for poses in (before, after):
        # From the found position by a wide loss, then by the loss of the judge.
        wide = triangulate(model, poses, held_out, loss_at(4 * noise), STEPS)
        points = triangulate(model, poses, held_out.at(wide), loss, STEPS)
        lengths.append(residual_lengths(model, poses, held_out.at(points)))
        losses.append(np.bincount(held_out.point, loss.value(lengths[-1]), minlength=len(held_out)))
    gain = losses[0] - losses[1]
    error = float(gain.std() / np.sqrt(max(len(gain), 1)))
    return CameraJudgement(
        len(held_out), float(np.median(lengths[0])), float(np.median(lengths[1])), float(losses[0].mean()),
        float(losses[1].mean()), float(gain.mean()) / error if error > 0 else 0.0, noise,
    )  # fmt: skip
