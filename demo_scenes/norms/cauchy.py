"""The logarithm of Cauchy's distribution: `eigenfairing view SCENE --with cauchy.py`. Its weight is found from differences."""

import numpy as np

import fairing


class Cauchy(fairing.Norm):
    """Large residuals count little, but more the larger they are."""

    name = "cauchy"

    def rho(self, x):
        return np.log1p(x**2)
