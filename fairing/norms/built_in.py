"""The norms of the options. One more is one more class here, and its name among those of `RobustOptions.norm`."""

from functools import cache

import numpy as np

from fairing.errors import InputError
from fairing.kernels.data import NormLoop
from fairing.norms.norm import Norm, Tabulated, tabulated

OWN = "own"
"""Name in the options of a norm of one's own."""


class GemanMcClure(Norm):
    """x^2 / (1 + x^2): never exceeds 1."""

    name = "geman_mcclure"
    outlier_threshold = 1 / np.sqrt(3)
    kernel = NormLoop.GEMAN_MCCLURE

    def rho(self, x: np.ndarray) -> np.ndarray:
        return x**2 / (1 + x**2)

    def weight(self, x: np.ndarray) -> np.ndarray:
        return 2 / (1 + x**2) ** 2


class PrintedGemanMcClure(GemanMcClure):
    """e^2 / (sigma + e^2), as printed in the paper."""

    name = "geman_mcclure_printed"

    def squared_scale(self, sigma: np.ndarray) -> np.ndarray:
        return sigma


class Huber(Norm):
    """x^2 up to 1, linear beyond."""

    name = "huber"
    outlier_threshold = np.inf
    kernel = NormLoop.HUBER

    def rho(self, x: np.ndarray) -> np.ndarray:
        return np.where(x <= 1, x**2, 2 * x - 1)

    def weight(self, x: np.ndarray) -> np.ndarray:
        return 2 / np.maximum(x, 1)


class LeastSquares(Norm):
    """x^2: no residual is rejected."""

    name = "least_squares"
    outlier_threshold = np.inf
    kernel = NormLoop.LEAST_SQUARES

    def rho(self, x: np.ndarray) -> np.ndarray:
        return x**2

    def weight(self, x: np.ndarray) -> np.ndarray:
        return np.full(x.shape, 2.0)


BUILT_IN: dict[str, Norm] = {
    norm.name: norm for norm in (GemanMcClure(), PrintedGemanMcClure(), Huber(), LeastSquares())
}


@cache
def _built_in(name: str) -> Tabulated:
    return tabulated(BUILT_IN[name])


def norm_of(name: str, own: Tabulated | None = None) -> Tabulated:
    """The norm with a name of the options.

    Args:
        own: the norm of one's own, if there is one.

    Raises:
        InputError: the name is that of a norm of one's own, and there is none.
    """
    if name != OWN:
        return _built_in(name)
    if own is None:
        raise InputError("option robust.norm: own: expected a norm of your own; give it with norm= or --with FILE")
    return own
