"""Robust losses of geometric residuals, and their weights in iteratively reweighted least squares.

A loss rho(r) behaves like r^2 / 2 near 0; its weight is rho'(r) / r, 1 at 0. All of them are concave in r^2, so that a
reweighted step cannot raise their sum where residuals are linear.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np


class Loss(Protocol):
    """A loss of residuals (r,) float in the unit of its scale."""

    def value(self, residuals: np.ndarray) -> np.ndarray:
        """(r,) float."""
        ...

    def weight(self, residuals: np.ndarray) -> np.ndarray:
        """(r,) float, 0 to 1."""
        ...


@dataclass(frozen=True)
class LeastSquares:
    """r^2 / 2: no residual is rejected."""

    def value(self, residuals: np.ndarray) -> np.ndarray:
        return 0.5 * residuals**2

    def weight(self, residuals: np.ndarray) -> np.ndarray:
        return np.ones(residuals.shape)


@dataclass(frozen=True)
class GemanMcClure:
    """s^2 r^2 / (2 (s^2 + r^2)) at scale s: a residual of s has a quarter of the weight, distant ones have none."""

    scale: float

    def value(self, residuals: np.ndarray) -> np.ndarray:
        return 0.5 * residuals**2 / (1 + (residuals / self.scale) ** 2)

    def weight(self, residuals: np.ndarray) -> np.ndarray:
        return 1 / (1 + (residuals / self.scale) ** 2) ** 2


@dataclass(frozen=True)
class Huber:
    """r^2 / 2 up to the scale, linear beyond it."""

    scale: float

    def value(self, residuals: np.ndarray) -> np.ndarray:
        size = np.abs(residuals)
        return np.where(size <= self.scale, 0.5 * residuals**2, self.scale * (size - 0.5 * self.scale))

    def weight(self, residuals: np.ndarray) -> np.ndarray:
        return 1 / np.maximum(1, np.abs(residuals) / self.scale)
