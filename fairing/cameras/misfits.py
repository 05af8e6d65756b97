"""Photos whose camera does not fit the others: an adjustment gives them no weight, because its loss is robust.

Such a photo is fitted alone to the points of the others (resection), by a loss whose scale follows its residuals, and its
given pose no longer counts: one camera that is wrong by 20 px says nothing about those that are wrong by 0.1 px.
"""

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from fairing.cameras import compiled
from fairing.cameras.adjustment import residual_lengths, weights_of
from fairing.cameras.observed_points import ObservedPoints
from fairing.cameras.pose_model import PARAMETERS, PoseModel
from fairing.optimize.loss import GemanMcClure

MISFIT = 5.0
"""A camera does not fit where the median residual of its photo is that many times the usual one, and more than `LEAST`."""
LEAST = 0.7  # px
STEPS = 30
FEWEST_OBSERVATIONS = 20
SCALE = 2.0
"""Scale of the loss of a resection, in median residuals of the photo."""


def find_misfits(model: PoseModel, poses: np.ndarray, observed: ObservedPoints) -> np.ndarray:
    """(v,) bool: photos whose camera does not fit, at poses (v, n), px."""
    return misfits_of(photo_medians(residual_lengths(model, poses, observed), observed.photo, len(model)))


def misfits_of(errors: np.ndarray) -> np.ndarray:
    """(v,) bool: photos whose camera does not fit, from the median reprojection error (v,) of each photo, px."""
    seen = errors[errors > 0]
    return errors > max(LEAST, MISFIT * np.median(seen)) if len(seen) else np.zeros(len(errors), bool)


def resected(model: PoseModel, poses: np.ndarray, observed: ObservedPoints, photo: int) -> np.ndarray:
    """(v, n) float, px: the poses with that of one photo fitted to the points, as they are.

    Gauss-Newton steps, reweighted; the loss's scale is the median residual of the step times `SCALE`.
    """
    mine = observed.photo == photo
    if mine.sum() < FEWEST_OBSERVATIONS:
        return poses
    seen = ObservedPoints(observed.positions, observed.point[mine], observed.photo[mine], observed.pixels[mine])
    best, least = poses, np.median(residual_lengths(model, poses, seen))
    for _ in range(STEPS):
        images = model.linearise(poses, seen)
        loss = GemanMcClure(SCALE * float(np.median(residual_lengths(model, poses, seen))))
        U, g, *_ = compiled.normal_blocks(
            images.J_pixel_wrt_pose[:, :, :PARAMETERS].copy(), images.J_pixel_wrt_point, images.pixels - seen.pixels,
            weights_of(images, seen, loss), seen.point, seen.photo, len(model), len(seen),
        )  # fmt: skip
        matrix = U[photo] + 1e-9 * np.trace(U[photo]) * np.eye(PARAMETERS) + 1e-300 * np.eye(PARAMETERS)
        poses = poses.copy()
        poses[photo, :PARAMETERS] -= cho_solve(cho_factor(matrix), g[photo])
        median = np.median(residual_lengths(model, poses, seen))
        if median < least:
            best, least = poses, median
    return best


def photo_medians(values: np.ndarray, photo: np.ndarray, n_photos: int) -> np.ndarray:
    """(v,) float: median of the values (o,) of each photo; 0 for a photo without any."""
    order = np.argsort(photo, kind="stable")
    parts = np.split(values[order], np.searchsorted(photo[order], np.arange(1, n_photos)))
    return np.array([np.median(part) if len(part) else 0.0 for part in parts])
