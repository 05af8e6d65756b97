"""Geman-McClure loss of geometric residuals in iteratively reweighted least squares."""

import numpy as np


def geman_mcclure_weights(residuals: np.ndarray, scale: float) -> np.ndarray:
    """(k,) float: 1 at a residual of 0, a quarter at the scale; residuals (k,) float in the unit of the scale."""
    return 1 / (1 + (residuals / scale) ** 2) ** 2
