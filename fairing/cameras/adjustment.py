"""Bundle adjustment: poses and points that explain the observations, the given poses as a Gaussian prior.

With r_o the reprojection residual of an observation, px, rho a robust loss, s the standard deviation of a coordinate of an
observation and (a_v, b_v) the parameters of a pose (see `pose_model`), the objective is

    E = sum_o rho(|r_o|) / s^2 + sum_v t_v (|a_v|^2 / (2 s_a^2) + |b_v|^2 / (2 s_b^2)) + sum_c |e_c|^2 / (2 s_e^2),

t_v the trust in the given pose, 1 or nearly 0, and e_c the intrinsics of a camera, if they are unknown.
The prior also holds the frame: observations do not change when all poses and points move by one similarity.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag, cho_factor, cho_solve

from fairing.cameras import compiled
from fairing.cameras.observed_points import ObservedPoints
from fairing.cameras.pose_model import INTRINSICS, PARAMETERS, PoseModel, Projected
from fairing.optimize.loss import Loss

FIRST_DAMPING = 1e-4
LARGEST_DAMPING = 1e6
BEHIND = 1e6
"""Residual in px of a point behind its camera: the robust losses give it no weight."""
CONVERGED = 1e-5
"""A step that lowers the objective by a smaller part of it is the last."""
POINT_FLOOR = 1e-9
"""Of the median trace of the points' matrices, added to their diagonals: a point may have no observation of any weight."""

OnStep = Callable[[np.ndarray, ObservedPoints], None]
"""Called after each step with the poses (v, n), px, and the points; what it raises ends the adjustment."""


@dataclass(frozen=True)
class Deviations:
    """Standard deviations, px: `observation` of a coordinate, `rotation`, `center` and `lens` of a parameter of the given poses
    and intrinsics. Of intrinsics that are not adjusted it is None."""

    observation: float
    rotation: float
    center: float
    lens: float | None = None

    def prior(self, model: PoseModel) -> np.ndarray:
        """(v, n) float, 1 / px^2: the prior's diagonal; that of shared intrinsics is divided among their photos."""
        of_pose = np.repeat([self.rotation**-2, self.center**-2], PARAMETERS // 2) * model.trust[:, None]
        if self.lens is None:
            return of_pose
        of_lens = np.full((len(model), INTRINSICS), self.lens**-2) / model.photos_of_lens[:, None]
        return np.concatenate([of_pose, of_lens], axis=1)


@dataclass(frozen=True, eq=False)
class System:
    """Normal equations of all poses, the points eliminated.

    With U, W, V the blocks of the normal matrix for photos, between photos and points, and for points, and T the matrix of
    `PoseModel.sharing`: S = T^T (U - W V^-1 W^T) T.

    Attributes:
        S: (u, u) float, the reduced camera system.
        g: (u,) float: its gradient.
        Z: (o, n, 3) float: the blocks of W L^-T with V = L L^T, one an observation.
        L_inverse: (p, 3, 3) float.
        g_points: (p, 3) float: L^-1 times the gradient by the points.
    """

    S: np.ndarray
    g: np.ndarray
    Z: np.ndarray
    L_inverse: np.ndarray
    g_points: np.ndarray


@dataclass(frozen=True, eq=False)
class Adjusted:
    """Attributes:
    poses: (v, n) float, px.
    points: (p, 3) float, world units.
    objectives: E at the start and after each accepted step, never increasing.
    """

    poses: np.ndarray
    points: np.ndarray
    objectives: tuple[float, ...]


def residual_lengths(model: PoseModel, poses: np.ndarray, observed: ObservedPoints) -> np.ndarray:
    """(o,) float, px: distances of projections from observations; `BEHIND` where the point is not in front of its camera."""
    pixels, depth = model.project(poses, observed)
    return _lengths(pixels, depth, observed)


def objective(model: PoseModel, poses: np.ndarray, observed: ObservedPoints, loss: Loss, sigma: Deviations) -> float:
    """E at poses (v, n), px, and the points of `observed`."""
    data = loss.value(residual_lengths(model, poses, observed)).sum() / sigma.observation**2
    return float(data + 0.5 * (poses**2 * sigma.prior(model)).sum())


def reduced_system(
    model: PoseModel, poses: np.ndarray, observed: ObservedPoints, loss: Loss, sigma: Deviations, damping: float = 0.0
) -> System:
    """Gauss-Newton's normal equations of E, the loss reweighted, each diagonal entry times 1 + `damping`."""
    v, p, point, photo = len(model), len(observed), observed.point, observed.photo
    images = model.linearise(poses, observed)
    U, g, V, g_points, W = compiled.normal_blocks(
        images.J_pixel_wrt_pose, images.J_pixel_wrt_point, images.pixels - observed.pixels,
        weights_of(images, observed, loss) / sigma.observation**2, point, photo, v, p,
    )  # fmt: skip
    prior = sigma.prior(model)
    U += prior[:, :, None] * np.eye(prior.shape[1])
    U += damping * U * np.eye(prior.shape[1])
    L_inverse = np.linalg.inv(np.linalg.cholesky(_damped(V, damping)))
    whitened = np.einsum("pij,pj->pi", L_inverse, g_points)
    half, g_less, Z = compiled.eliminated(W, L_inverse, whitened, observed.starts, point, photo, v)
    g += poses * prior - g_less
    T = model.sharing
    S = np.asarray(block_diag(*U)) - half - half.T
    return System(T.T @ (T.T @ S).T, T.T @ g.ravel(), Z, L_inverse, whitened)


def adjust(
    model: PoseModel,
    poses: np.ndarray,
    observed: ObservedPoints,
    loss: Loss,
    sigma: Deviations,
    iterations: int,
    on_step: OnStep = lambda poses, observed: None,
) -> Adjusted:
    """Poses and points of a lower objective, by Levenberg-Marquardt steps from poses (v, n), px, and the observed positions.

    A step that would raise the objective is not made; the damping is then 10 times as large.
    """
    energies, damping = [objective(model, poses, observed, loss, sigma)], FIRST_DAMPING
    for _ in range(iterations):
        while damping <= LARGEST_DAMPING:
            turned, moved = _step(model, reduced_system(model, poses, observed, loss, sigma, damping), observed)
            new_poses, new = poses + turned, observed.at(observed.positions + moved)
            energy = objective(model, new_poses, new, loss, sigma)
            if energy <= energies[-1]:
                break
            damping *= 10
        else:
            break
        gain = energies[-1] - energy
        poses, observed, damping = new_poses, new, damping / 10
        energies.append(energy)
        on_step(poses, observed)
        if gain <= CONVERGED * energy:
            break
    return Adjusted(poses, observed.positions, tuple(energies))


def triangulate(
    model: PoseModel, poses: np.ndarray, observed: ObservedPoints, loss: Loss, iterations: int
) -> np.ndarray:
    """(p, 3) float, world units: points of lower robust loss with the poses (v, n), px, held.

    Each point takes Levenberg-Marquardt steps of its own: one that would raise its loss is not made.
    """

    def losses(points: np.ndarray) -> np.ndarray:
        lengths = residual_lengths(model, poses, observed.at(points))
        return compiled.sums(loss.value(lengths), observed.point, len(observed))

    points = observed.positions
    now, damping = losses(points), np.full(len(points), FIRST_DAMPING)
    for _ in range(iterations):
        images = model.linearise(poses, observed.at(points))
        V, g = compiled.point_blocks(
            images.J_pixel_wrt_point, images.pixels - observed.pixels, weights_of(images, observed, loss),
            observed.point, len(points),
        )  # fmt: skip
        V = _damped(V, damping[:, None, None])
        moved = points - np.linalg.solve(V, g[:, :, None])[:, :, 0]
        then = losses(moved)
        better = then <= now
        points = np.where(better[:, None], moved, points)
        now, damping = np.where(better, then, now), np.where(better, damping / 10, damping * 10)
    return points


def _step(model: PoseModel, system: System, observed: ObservedPoints) -> tuple[np.ndarray, np.ndarray]:
    """Steps of the photos' parameters (v, n), px, and of the points (p, 3), world units."""
    turned = -(model.sharing @ cho_solve(cho_factor(system.S), system.g)).reshape(len(model), -1)
    whitened = system.g_points + compiled.point_change(
        system.Z, turned, observed.point, observed.photo, len(observed)
    )  # fmt: skip
    return turned, -np.einsum("pji,pj->pi", system.L_inverse, whitened)


def weights_of(images: Projected, observed: ObservedPoints, loss: Loss) -> np.ndarray:
    """(o,) float: the loss's weights of linearised observations."""
    length = _lengths(images.pixels, images.depth, observed)
    return np.where(length < BEHIND, loss.weight(length), 0)


def _lengths(pixels: np.ndarray, depth: np.ndarray, observed: ObservedPoints) -> np.ndarray:
    """(o,) float, px: see `residual_lengths`."""
    distance = np.linalg.norm(pixels - observed.pixels, axis=1)
    return np.where((depth > 0) & (distance < BEHIND), distance, BEHIND)


def _damped(V: np.ndarray, damping: float | np.ndarray) -> np.ndarray:
    """Matrices V (p, 3, 3) of points with their diagonals times 1 + `damping`, and no diagonal zero."""
    floor = POINT_FLOOR * np.median(np.trace(V, axis1=1, axis2=2)) + 1e-300
    return V + (damping * V + floor) * np.eye(3)
