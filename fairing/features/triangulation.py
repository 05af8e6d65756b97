"""Triangulation: the point of each track, the covariance of its position, and which observations agree with it."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fairing.camera import Camera
from fairing.features.options import FeatureOptions


class Triangulated(NamedTuple):
    """Attributes:
    positions: (t, 3) float, world units; anything where `is_good` is false.
    is_good: (t,) bool: enough photos see the point from directions different enough.
    kept: (o,) bool: observations whose residual is within the limit.
    """

    positions: np.ndarray
    is_good: np.ndarray
    kept: np.ndarray


def triangulate_tracks(
    cameras: Sequence[Camera],
    offsets: np.ndarray,
    photos: np.ndarray,
    pixels: np.ndarray,
    sigma: np.ndarray,
    options: FeatureOptions,
) -> Triangulated:
    """The point of each track that minimises the sum of its squared reprojection residuals, each divided by its sigma.

    While a residual of a track exceeds `options.residual`, its worst observation is dropped and the point found again.

    Args:
        offsets: (t + 1,) int: track t has the observations `offsets[t]` to `offsets[t + 1]`.
        photos: (o,) int. pixels: (o, 2) float, px, integers at pixel centres.
        sigma: (o,) float: standard deviation of a keypoint's coordinates, px or any multiple of it.
    """
    P = np.array([camera.image_from_world for camera in cameras])
    centers = np.array([camera.center for camera in cameras])
    n = len(offsets) - 1
    track = np.repeat(np.arange(n), np.diff(offsets))
    positions, kept = np.zeros((n, 3)), np.ones(len(track), dtype=bool)
    is_good = np.diff(offsets) >= options.views
    open_tracks = is_good.copy()
    while open_tracks.any():
        ids = np.flatnonzero(open_tracks)
        observations = np.flatnonzero(kept & open_tracks[track])
        starts = np.flatnonzero(np.diff(track[observations], prepend=-1))
        row = np.repeat(np.arange(len(ids)), np.diff(starts, append=len(observations)))
        points, residual = _solve(
            P, centers, photos[observations], pixels[observations], sigma[observations], starts, row
        )
        positions[ids] = points
        worst = np.maximum.reduceat(residual, starts)
        fails = ~(worst <= options.residual)
        drop = np.flatnonzero(fails[row] & (residual == worst[row]))
        drop = drop[np.diff(row[drop], prepend=-1) > 0]  # one a track
        kept[observations[drop]] = False
        left = np.bincount(row, minlength=len(ids)) - fails
        is_good[ids[left < options.views]] = False
        open_tracks[:] = False
        open_tracks[ids[fails & (left >= options.views)]] = True
    rays = positions[track] - centers[photos]
    is_good &= _widest_angle(rays, track, kept, n) >= np.radians(options.angle)
    return Triangulated(positions, is_good, kept & is_good[track])


def information(
    P: np.ndarray, points: np.ndarray, photos: np.ndarray, sigma: np.ndarray, starts: np.ndarray, row: np.ndarray
) -> np.ndarray:
    """(p, 3, 3): sum of J^T J / sigma^2 over the observations of each point, J = d pixel / d point.

    Args:
        P: (V, 3, 4) camera matrices. points: (p, 3). photos, row: (o,) int: photo and point of each observation, ordered
            by point. sigma: (o,) px. starts: (p,) int: first observation of each point.
    """
    _, J = _project(P[photos], points[row])
    J /= sigma[:, None, None]
    return np.add.reduceat(np.einsum("oki,okj->oij", J, J), starts)


def reprojection(P: np.ndarray, points: np.ndarray, photos: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """(o, 2) float, px: where points (o, 3) project to less where they were observed (o, 2)."""
    return _project(P[photos], points)[0] - pixels


def _solve(
    P: np.ndarray, centers: np.ndarray, photos: np.ndarray, pixels: np.ndarray, sigma: np.ndarray, starts: np.ndarray,
    row: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Points (p, 3) and the residual (o,) of each observation, px; infinite for one behind its camera."""
    M = P[photos]
    rays = np.linalg.solve(M[:, :, :3], np.column_stack([pixels, np.ones(len(pixels))])[..., None])[..., 0]
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    across = np.eye(3) - rays[:, :, None] * rays[:, None, :]
    target = np.einsum("oij,oj->oi", across, centers[photos])
    points = _solved(np.add.reduceat(across, starts), np.add.reduceat(target, starts))
    weight = 1 / sigma**2
    for _ in range(6):  # Gauss-Newton steps from the point nearest to all rays; most points need three
        uv, J = _project(M, points[row])
        weighted = J * weight[:, None, None]
        H = np.add.reduceat(np.einsum("oki,okj->oij", weighted, J), starts)
        g = np.add.reduceat(np.einsum("oki,ok->oi", weighted, uv - pixels), starts)
        step = _solved(H, g)
        points = points - np.where(np.isfinite(step), step, 0)
    uv, _ = _project(M, points[row])
    depth = np.einsum("oi,oi->o", M[:, 2, :3], points[row]) + M[:, 2, 3]
    residual = np.linalg.norm(uv - pixels, axis=1)
    return points, np.where((depth > 0) & np.isfinite(residual), residual, np.inf)


def _project(P: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pixels (o, 2) and d pixel / d point (o, 2, 3) of points (o, 3), each in its own camera (o, 3, 4)."""
    homogeneous = np.einsum("oij,oj->oi", P[:, :, :3], points) + P[:, :, 3]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        uv = homogeneous[:, :2] / homogeneous[:, 2:]
        J = (P[:, :2, :3] - uv[:, :, None] * P[:, 2:, :3]) / homogeneous[:, 2, None, None]
    return uv, J


def _solved(A: np.ndarray, b: np.ndarray) -> np.ndarray:
    """x (p, 3) of A x = b for symmetric, semidefinite A (p, 3, 3); NaN where A or b is not finite."""
    good = np.isfinite(A).all(axis=(1, 2)) & np.isfinite(b).all(axis=1)
    result = np.full(b.shape, np.nan)
    trace = np.trace(A[good], axis1=1, axis2=2)[:, None, None]
    damping = 1e-12 * trace * np.eye(3) + 1e-300 * np.eye(3)  # rays may be parallel
    result[good] = np.linalg.solve(A[good] + damping, b[good][..., None])[..., 0]
    return result


def _widest_angle(rays: np.ndarray, track: np.ndarray, kept: np.ndarray, n: int) -> np.ndarray:
    """(n,) float, radians: the largest angle between two kept rays (o, 3) of each track."""
    rays, track = rays[kept], track[kept]
    unit = rays / np.maximum(np.linalg.norm(rays, axis=1, keepdims=True), 1e-300)
    least = np.ones(n)
    for shift in range(1, int(np.bincount(track, minlength=1).max(initial=1))):
        same = track[shift:] == track[:-shift]
        cosine = (unit[shift:][same] * unit[:-shift][same]).sum(axis=1)
        np.minimum.at(least, track[shift:][same], cosine)
    return np.arccos(np.clip(least, -1, 1))
