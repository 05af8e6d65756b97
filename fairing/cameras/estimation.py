"""Bundle adjustment with standard deviations estimated from its residuals.

The standard deviations of observations, given rotations and given centres are rarely known. They are variance components
(Foerstner and Wrobel, Photogrammetric Computer Vision, 2016, section 4.2.4): a group of n residuals with one deviation and
redundancy r has the variance (sum of squares) / r. For the parameters of the given poses r = n - trace(C) / s^2, with C
their block of the inverse of the reduced camera system: r counts what the observations determine, so the frame, which
they do not determine, adds nothing.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from fairing.cameras.adjustment import (
    Adjusted,
    Deviations,
    OnStep,
    adjust,
    reduced_system,
    residual_lengths,
    triangulate,
)
from fairing.cameras.misfits import find_misfits, resected
from fairing.cameras.observed_points import ObservedPoints
from fairing.cameras.pose_model import PARAMETERS, PoseModel
from fairing.optimize.loss import GemanMcClure

FIRST_DEVIATION = 1.0  # px, of given rotations and centres
LEAST_DEVIATION = 0.01  # px
LEAST_NOISE = 0.02  # px
LOSS_SCALE = 3.0
"""Scale of the loss, in standard deviations of an observation."""
MEDIAN_LENGTH = np.sqrt(2 * np.log(2))
"""Median length of a vector of two standard normal coordinates."""
ROUNDS = 15
STEPS_OF_ROUND = 2
LAST_STEPS = 10
SAME = 0.02
"""The rounds end when no deviation changes by a larger part of it."""
TRIANGULATION_STEPS = 5
NO_TRUST = 1e-6
MOST_STEPS = ROUNDS * STEPS_OF_ROUND + LAST_STEPS


@dataclass(frozen=True, eq=False)
class Estimate:
    """Attributes:
    poses: (v, n) float, px, see `pose_model`.
    points: (p, 3) float, world units.
    sigma: the estimated deviations.
    """

    poses: np.ndarray
    points: np.ndarray
    sigma: Deviations
    model: PoseModel


def loss_at(noise: float) -> GemanMcClure:
    """The loss for observations whose coordinates have standard deviation `noise`, px."""
    return GemanMcClure(LOSS_SCALE * noise)


def estimate_poses(
    model: PoseModel,
    observed: ObservedPoints,
    start: np.ndarray | None = None,
    on_step: OnStep = lambda poses, observed: None,
) -> Estimate:
    """Poses, points and standard deviations, each found with the others as they are, in turn.

    Where cameras do not fit the others afterwards, they are fitted alone and all is estimated again, see `misfits`.

    Args:
        start: (v, n) float, px: first poses; default: the given ones. The prior is about the given ones in any case.
        on_step: see `OnStep`.
    """
    poses = model.given if start is None else start
    estimate = _estimated(model, observed, poses, on_step)
    observed = observed.at(estimate.points)
    misfits = find_misfits(model, estimate.poses, observed)
    if not misfits.any():
        return estimate
    poses = estimate.poses
    for photo in np.flatnonzero(misfits).tolist():
        poses = resected(model, poses, observed, photo)
    released = replace(model, trust=np.where(misfits, NO_TRUST, model.trust))
    return _estimated(released, observed, poses, on_step)


def _estimated(model: PoseModel, observed: ObservedPoints, poses: np.ndarray, on_step: OnStep) -> Estimate:
    noise = _noise(model, poses, observed)
    points = triangulate(model, poses, observed, loss_at(noise), TRIANGULATION_STEPS)
    observed = observed.at(points)
    of_lens = FIRST_DEVIATION if model.adjusts_lens else None
    sigma = Deviations(_noise(model, poses, observed), FIRST_DEVIATION, FIRST_DEVIATION, of_lens)
    for _ in range(ROUNDS):
        found = adjust(model, poses, observed, loss_at(sigma.observation), sigma, STEPS_OF_ROUND, on_step)
        poses, observed = found.poses, observed.at(found.points)
        before, sigma = sigma, _deviations(model, found, observed, sigma)
        changes = [
            abs(after / b - 1) for b, after in zip(vars(before).values(), vars(sigma).values(), strict=True) if b
        ]
        if max(changes) <= SAME:
            break
    found = adjust(model, poses, observed, loss_at(sigma.observation), sigma, LAST_STEPS, on_step)
    return Estimate(found.poses, found.points, sigma, model)


def _deviations(model: PoseModel, found: Adjusted, observed: ObservedPoints, sigma: Deviations) -> Deviations:
    """The deviations that the residuals of an adjustment with deviations `sigma` show."""
    noise = _noise(model, found.poses, observed)
    sigma = replace(sigma, observation=noise)
    system = reduced_system(model, found.poses, observed, loss_at(noise), sigma)
    variance = np.diag(cho_solve(cho_factor(system.S), np.eye(len(system.S))))
    n_poses, trusted = PARAMETERS * len(model), model.trust > NO_TRUST
    of_poses = variance[:n_poses].reshape(-1, PARAMETERS)[trusted]
    rotation, center = (
        _deviation(found.poses[trusted, part], of_poses[:, part], s)
        for part, s in ((slice(0, 3), sigma.rotation), (slice(3, 6), sigma.center))
    )
    if sigma.lens is None:
        return Deviations(noise, rotation, center)
    _, first = np.unique(model.lens, return_index=True)
    return Deviations(
        noise, rotation, center, _deviation(found.poses[first, PARAMETERS:], variance[n_poses:], sigma.lens)
    )


def _deviation(parameters: np.ndarray, variance: np.ndarray, s: float) -> float:
    """Standard deviation of a group of parameters whose variances were found with the deviation s, px."""
    redundancy = max(parameters.size - variance.sum() / s**2, 1.0)
    return max(float(np.sqrt((parameters**2).sum() / redundancy)), LEAST_DEVIATION)


def _noise(model: PoseModel, poses: np.ndarray, observed: ObservedPoints) -> float:
    """Standard deviation of a coordinate of an observation, px, from the median residual.

    Of 2 n coordinates, 3 for each point and the parameters of each photo are explained; the residuals are smaller accordingly.
    """
    lengths = residual_lengths(model, poses, observed)
    n = 2 * len(lengths)
    explained = 3 * len(observed) + model.given.size
    return max(float(np.median(lengths)) / MEDIAN_LENGTH * np.sqrt(n / max(n - explained, 1)), LEAST_NOISE)
