"""Least squares as a loss: with it, robust fits have solutions that are known in closed form."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Square:
    """r^2 / 2: least squares."""

    def value(self, residuals: np.ndarray) -> np.ndarray:
        return 0.5 * residuals**2

    def weight(self, residuals: np.ndarray) -> np.ndarray:
        return np.ones(len(residuals))
