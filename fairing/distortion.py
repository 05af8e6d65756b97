"""Models of lens distortion: from rays to distorted rays and back.

A ray (x, y, 1) in camera axes (x right, y down, z forward) is its (x, y); r^2 = x^2 + y^2. The distorted ray is the one
at which a pinhole camera would show it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

Rays = np.ndarray
"""(..., 2) float: x and y of rays (x, y, 1)."""
Mapping = Callable[[Rays, np.ndarray], Rays]
"""Rays from rays and the parameters of a model."""

_ITERATIONS = 60
_CONVERGED = 1e-13
_STEP = 1e-6  # of central differences, whose error only slows the convergence


@dataclass(frozen=True)
class DistortionModel:
    """A family of lenses.

    Attributes:
        names: of the parameters, in order.
        distort: distorted rays from rays; NaN where a ray has none.
        undistort: rays from distorted rays (n, 2); NaN or a ray that `distort` does not bring back where there is none.
    """

    names: tuple[str, ...]
    distort: Mapping
    undistort: Mapping


def invert(mapping: Mapping, rays: Rays, parameters: np.ndarray) -> Rays:
    """Rays (n, 2) that the mapping brings to the given rays (n, 2), by Newton's method; NaN where the image folds.

    The start is the given ray itself: lenses are monotonic from the axis to their fold, and the steps approach the
    solution from one side.
    """
    found = rays.copy()
    with np.errstate(all="ignore"):
        for _ in range(_ITERATIONS):
            missed = mapping(found, parameters) - rays
            if not np.nanmax(np.abs(missed), initial=0) > _CONVERGED:
                break
            step = _STEP * (1 + np.abs(found).max(axis=1, initial=0))[:, None]
            along_x, along_y = step * (1, 0), step * (0, 1)
            J_x = (mapping(found + along_x, parameters) - mapping(found - along_x, parameters)) / (2 * step)
            J_y = (mapping(found + along_y, parameters) - mapping(found - along_y, parameters)) / (2 * step)
            determinant = J_x[:, 0] * J_y[:, 1] - J_x[:, 1] * J_y[:, 0]
            determinant[~(determinant > 0)] = np.nan
            found[:, 0] -= (J_y[:, 1] * missed[:, 0] - J_y[:, 0] * missed[:, 1]) / determinant
            found[:, 1] -= (J_x[:, 0] * missed[:, 1] - J_x[:, 1] * missed[:, 0]) / determinant
    return found


def _with_tangential(rays: Rays, radial: np.ndarray, p1: float, p2: float) -> Rays:
    x, y = rays[..., 0], rays[..., 1]
    r2 = x * x + y * y
    return np.stack(
        [x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x), y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y],
        axis=-1,
    )


def _polynomial(rays: Rays, parameters: np.ndarray) -> Rays:
    k1, k2, p1, p2, k3, k4, k5, k6 = parameters
    r2 = (rays**2).sum(axis=-1)
    radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    return _with_tangential(rays, radial, p1, p2)


def _four_radial(rays: Rays, parameters: np.ndarray) -> Rays:
    k1, k2, p1, p2, k3, k4 = parameters
    r2 = (rays**2).sum(axis=-1)
    return _with_tangential(rays, 1 + r2 * (k1 + r2 * (k2 + r2 * (k3 + r2 * k4))), p1, p2)


def _fisheye(rays: Rays, parameters: np.ndarray) -> Rays:
    k1, k2, k3, k4 = parameters
    r = np.sqrt((rays**2).sum(axis=-1))
    angle = np.arctan(r)
    a2 = angle * angle
    distorted = angle * (1 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4))))
    scale = np.divide(distorted, r, out=np.ones_like(r), where=r > 1e-12)
    return rays * scale[..., None]


def _measured_radial(rays: Rays, parameters: np.ndarray) -> Rays:
    """Rays from distorted rays: VisualSFM's polynomial is one of the distorted radius."""
    return rays * (1 + parameters[0] * (rays**2).sum(axis=-1, keepdims=True))


def _division(rays: Rays, parameters: np.ndarray) -> Rays:
    """Rays from distorted rays."""
    return rays / (1 + parameters[0] * (rays**2).sum(axis=-1, keepdims=True))


def _invert_all(mapping: Mapping, rays: Rays, parameters: np.ndarray) -> Rays:
    return invert(mapping, rays.reshape(-1, 2), parameters).reshape(rays.shape)


MODELS: dict[str, DistortionModel] = {
    "polynomial": DistortionModel(
        ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"), _polynomial, partial(invert, _polynomial)
    ),
    "four radial": DistortionModel(("k1", "k2", "p1", "p2", "k3", "k4"), _four_radial, partial(invert, _four_radial)),
    "fisheye": DistortionModel(("k1", "k2", "k3", "k4"), _fisheye, partial(invert, _fisheye)),
    "division": DistortionModel(("k",), partial(_invert_all, _division), _division),
    "measured radial": DistortionModel(("r1",), partial(_invert_all, _measured_radial), _measured_radial),
}
"""Models by name.

- polynomial: Brown's, in OpenCV's notation, x' = x s + 2 p1 x y + p2 (r^2 + 2 x^2), y' = y s + 2 p2 x y + p1 (r^2 + 2 y^2)
  with s = (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6).
- four radial: the same with s = 1 + k1 r^2 + k2 r^4 + k3 r^6 + k4 r^8 (Metashape, RealityScan, nerfstudio).
- fisheye: equidistant, as OpenCV's fisheye: (x', y') = (x, y) a (1 + k1 a^2 + k2 a^4 + k3 a^6 + k4 a^8) / r, a = atan(r).
- division: the ray is the distorted ray divided by 1 + k r'^2 (Fitzgibbon 2001; COLMAP).
- measured radial: the ray is the distorted ray times 1 + r1 r'^2 (VisualSFM, which corrects measurements instead of
  distorting projections: the normalized measurement distortion of its bundle adjustment).
"""
