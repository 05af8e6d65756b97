"""Trial of lenses: whether held-out points would be clearly better if the distortion of the photos were unknown, too.

Wrong poses and a wrong lens are told apart by what is left: poses take up most of a distortion, but not what grows with the
distance from the centre of the photo.
"""

from dataclasses import replace

import numpy as np

from fairing.cameras.adjustment import OnStep, adjust
from fairing.cameras.estimation import Estimate, loss_at
from fairing.cameras.judge import judge_cameras
from fairing.cameras.observed_points import ObservedPoints
from fairing.cameras.pose_model import INTRINSICS, PoseModel

LENS_DEVIATION = 10.0  # px, of given intrinsics: wide, since what is looked for is large
STEPS = 5
"""Enough to decide (ledger: trial of lenses)."""
LEAST_BEND = 1.0  # px, of the observation that the distortion moves farthest


def lens_note(estimate: Estimate, training: ObservedPoints, held_out: ObservedPoints, on_step: OnStep) -> str:
    """A sentence if the photos look distorted by a lens of which their cameras do not tell, else "".

    Args:
        estimate: of poses with the given intrinsics.
        training: the points that it was adjusted to.
        held_out: other points.
        on_step: see `OnStep`.
    """
    model = replace(estimate.model, adjusts_lens=True)
    unbent = np.hstack([estimate.poses, np.zeros((len(model), INTRINSICS))])
    noise = estimate.sigma.observation
    sigma = replace(estimate.sigma, lens=LENS_DEVIATION)
    bent = adjust(model, unbent, training.at(estimate.points), loss_at(noise), sigma, STEPS, on_step).poses
    judgement = judge_cameras(model, unbent, bent, held_out, noise)
    bend = _displacements(model, bent, training).max()
    if not judgement.is_clear or bend < LEAST_BEND:
        return ""
    return (
        f"photos look distorted, by up to {bend:.1f} px: held-out points {judgement.error_before:.2f} px from their "
        f"observations, {judgement.error_after:.2f} px with a distortion of the lens; try --cameras refine_lens"
    )


def _displacements(model: PoseModel, poses: np.ndarray, observed: ObservedPoints) -> np.ndarray:
    """(o,) float, px: by how much the distortion at parameters (v, n), px, moves each observation along its radius."""
    K, k = model.intrinsics_at(poses)[observed.photo], model.distortion_at(poses)[observed.photo]
    offset = observed.pixels - K[:, :2, 2]
    squared = ((offset / K[:, [0, 1], [0, 1]]) ** 2).sum(axis=1)
    return np.linalg.norm(offset, axis=1) * np.abs(k[:, 0] * squared + k[:, 1] * squared**2)
