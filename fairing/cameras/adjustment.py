"""Bundle adjustment: poses and points that explain the observations, the given poses as a Gaussian prior.

With r_o the reprojection residual of an observation, px, rho a robust loss, s the standard deviation of a coordinate of an
observation and (a_v, b_v) the parameters of a pose (see `pose_model`), the objective is

    E = sum_o rho(|r_o|) / s^2 + sum_v |a_v|^2 / (2 s_a^2) + |b_v|^2 / (2 s_b^2).

The prior also holds the frame: observations do not change when all poses and points move by one similarity.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag, cho_factor, cho_solve
from scipy.sparse import csr_array

from fairing.cameras.observed_points import ObservedPoints
from fairing.cameras.pose_model import PARAMETERS, PoseModel
from fairing.optimize.loss import Loss

FIRST_DAMPING = 1e-4
LARGEST_DAMPING = 1e6
BEHIND = 1e6
"""Residual in px of a point behind its camera: the robust losses give it no weight."""
CONVERGED = 1e-5
"""A step that lowers the objective by a smaller part of it is the last."""
POINT_FLOOR = 1e-9
"""Of the median trace of the points' matrices, added to their diagonals: a point may have no observation of any weight."""

MOST_DENSE_ROWS = 400
COLUMNS_AT_ONCE = 3000


@dataclass(frozen=True)
class Deviations:
    """Standard deviations, px: `observation` of a coordinate, `rotation` and `center` of a parameter of the given poses."""

    observation: float
    rotation: float
    center: float

    @property
    def prior(self) -> np.ndarray:
        """(6,) float, 1 / px^2: the prior's diagonal for one pose."""
        return np.repeat([self.rotation**-2, self.center**-2], PARAMETERS // 2)


@dataclass(frozen=True, eq=False)
class System:
    """Normal equations of all poses, the points eliminated.

    With U, W, V the blocks of the normal matrix for poses, between poses and points, and for points:
    S = U - W V^-1 W^T.

    Attributes:
        S: (6 v, 6 v) float, the reduced camera system.
        g: (6 v,) float: its gradient.
        Z: (6 v, 3 p) sparse: W L^-T with V = L L^T.
        L_inverse: (p, 3, 3) float.
        g_points: (p, 3) float: L^-1 times the gradient by the points.
    """

    S: np.ndarray
    g: np.ndarray
    Z: csr_array
    L_inverse: np.ndarray
    g_points: np.ndarray


@dataclass(frozen=True, eq=False)
class Adjusted:
    """Attributes:
    poses: (v, 6) float, px.
    points: (p, 3) float, world units.
    objectives: E at the start and after each accepted step, never increasing.
    """

    poses: np.ndarray
    points: np.ndarray
    objectives: tuple[float, ...]


def residual_lengths(model: PoseModel, poses: np.ndarray, observed: ObservedPoints) -> np.ndarray:
    """(o,) float, px: distances of projections from observations; `BEHIND` where the point is not in front of its camera."""
    pixels, depth = model.project(poses, observed.positions[observed.point], observed.photo)
    distance = np.linalg.norm(pixels - observed.pixels, axis=1)
    return np.where((depth > 0) & (distance < BEHIND), distance, BEHIND)


def objective(model: PoseModel, poses: np.ndarray, observed: ObservedPoints, loss: Loss, sigma: Deviations) -> float:
    """E at poses (v, 6), px, and the points of `observed`."""
    data = loss.value(residual_lengths(model, poses, observed)).sum() / sigma.observation**2
    return float(data + 0.5 * (poses**2 @ sigma.prior).sum())


def reduced_system(
    model: PoseModel, poses: np.ndarray, observed: ObservedPoints, loss: Loss, sigma: Deviations, damping: float = 0.0
) -> System:
    """Gauss-Newton's normal equations of E, the loss reweighted, each diagonal entry times 1 + `damping`."""
    v, p, point, photo = len(model), len(observed), observed.point, observed.photo
    images = model.linearise(poses, observed.positions[point], photo)
    length = residual_lengths(model, poses, observed)
    used = length < BEHIND
    weight = np.where(used, loss.weight(length), 0) / sigma.observation**2
    # Without weight, what has no meaning counts as zero.
    A, B, r = (
        np.where(used.reshape(-1, *[1] * (x.ndim - 1)), x, 0)
        for x in (images.J_pixel_wrt_pose, images.J_pixel_wrt_point, images.pixels - observed.pixels)
    )
    A_weighted, B_weighted = A * weight[:, None, None], B * weight[:, None, None]
    by_photo = np.argsort(photo, kind="stable")
    U = _sums(_products(A_weighted, A)[by_photo], photo[by_photo], v)
    U += np.diag(sigma.prior)
    g = _sums(np.einsum("oki,ok->oi", A_weighted, r)[by_photo], photo[by_photo], v) + poses * sigma.prior
    V = _sums(_products(B_weighted, B), point, p)
    g_points = _sums(np.einsum("oki,ok->oi", B_weighted, r), point, p)
    U += damping * U * np.eye(PARAMETERS)
    V += damping * V * np.eye(3)
    V += (POINT_FLOOR * np.median(np.trace(V, axis1=1, axis2=2)) + 1e-300) * np.eye(3)
    L_inverse = np.linalg.inv(np.linalg.cholesky(V))
    blocks = _products(A_weighted, B) @ L_inverse[point].transpose(0, 2, 1)
    rows = PARAMETERS * photo[:, None, None] + np.arange(PARAMETERS)[:, None]
    columns = 3 * point[:, None, None] + np.arange(3)
    rows, columns = (np.broadcast_to(index, blocks.shape).ravel() for index in (rows, columns))
    Z = csr_array((blocks.ravel(), (rows, columns)), shape=(PARAMETERS * v, 3 * p))
    whitened = np.einsum("pij,pj->pi", L_inverse, g_points)
    S = block_diag(*U) - _outer(Z, PARAMETERS * v, 3 * p)
    return System(S, g.ravel() - Z @ whitened.ravel(), Z, L_inverse, whitened)


def adjust(
    model: PoseModel, poses: np.ndarray, observed: ObservedPoints, loss: Loss, sigma: Deviations, iterations: int
) -> Adjusted:
    """Poses and points of a lower objective, by Levenberg-Marquardt steps from poses (v, 6), px, and the observed positions.

    A step that would raise the objective is not made; the damping is then 10 times as large.
    """
    energies, damping = [objective(model, poses, observed, loss, sigma)], FIRST_DAMPING
    for _ in range(iterations):
        while damping <= LARGEST_DAMPING:
            turned, moved = _step(reduced_system(model, poses, observed, loss, sigma, damping))
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
        if gain <= CONVERGED * energy:
            break
    return Adjusted(poses, observed.positions, tuple(energies))


def triangulate(
    model: PoseModel, poses: np.ndarray, observed: ObservedPoints, loss: Loss, iterations: int
) -> np.ndarray:
    """(p, 3) float, world units: points of lower robust loss with the poses (v, 6), px, held.

    Each point takes Levenberg-Marquardt steps of its own: one that would raise its loss is not made.
    """

    def losses(points: np.ndarray) -> np.ndarray:
        lengths = residual_lengths(model, poses, observed.at(points))
        return _sums(loss.value(lengths), observed.point, len(observed))

    points = observed.positions
    now, damping = losses(points), np.full(len(points), FIRST_DAMPING)
    for _ in range(iterations):
        images = model.linearise(poses, points[observed.point], observed.photo)
        lengths = residual_lengths(model, poses, observed.at(points))
        used = lengths < BEHIND
        J = np.where(used[:, None, None], images.J_pixel_wrt_point, 0)
        r = np.where(used[:, None], images.pixels - observed.pixels, 0)
        weighted = J * loss.weight(lengths)[:, None, None]
        V = _sums(_products(weighted, J), observed.point, len(points))
        g = _sums(np.einsum("oki,ok->oi", weighted, r), observed.point, len(points))
        V += damping[:, None, None] * V * np.eye(3)
        V += (POINT_FLOOR * np.median(np.trace(V, axis1=1, axis2=2)) + 1e-300) * np.eye(3)
        moved = points - np.linalg.solve(V, g[:, :, None])[:, :, 0]
        then = losses(moved)
        better = then <= now
        points = np.where(better[:, None], moved, points)
        now, damping = np.where(better, then, now), np.where(better, damping / 10, damping * 10)
    return points


def _step(system: System) -> tuple[np.ndarray, np.ndarray]:
    """Steps of the poses (v, 6), px, and of the points (p, 3), world units."""
    turned = -cho_solve(cho_factor(system.S), system.g)
    whitened = system.g_points.ravel() + system.Z.T @ turned
    moved = -np.einsum("pji,pj->pi", system.L_inverse, whitened.reshape(-1, 3))
    return turned.reshape(-1, PARAMETERS), moved


def _products(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """(o, i, j) float: A_o^T B_o of A (o, 2, i) and B (o, 2, j)."""
    return A[:, 0, :, None] * B[:, 0, None, :] + A[:, 1, :, None] * B[:, 1, None, :]


def _outer(Z: csr_array, rows: int, columns: int) -> np.ndarray:
    """Z Z^T, dense, of Z (rows, columns). With few rows, dense products of parts of Z are faster than a sparse product."""
    if rows > MOST_DENSE_ROWS:
        return (Z @ Z.T).toarray()
    by_column, result = Z.tocsc(), np.zeros((rows, rows))
    for first in range(0, columns, COLUMNS_AT_ONCE):
        part = by_column[:, first : first + COLUMNS_AT_ONCE].toarray()
        result += part @ part.T
    return result


def _sums(values: np.ndarray, index: np.ndarray, n: int) -> np.ndarray:
    """(n, ...) float: sums of values (o, ...) with the same index (o,), which ascends."""
    result = np.zeros((n, *values.shape[1:]))
    if len(values):
        starts = np.flatnonzero(np.diff(index, prepend=-1))
        result[index[starts]] = np.add.reduceat(values, starts)
    return result
