"""Tukey's biweight instead of the norm of Geman and McClure: `eigenfairing view SCENE --with tukey.py`."""

import numpy as np

import fairing

CUT = 3.0  # in units of sigma


class Tukey(fairing.Norm):
    """Residuals beyond three sigma have no influence at all."""

    name = "tukey"

    def rho(self, x):
        return CUT**2 / 3 * (1 - (1 - np.minimum(x / CUT, 1) ** 2) ** 3)

    def weight(self, x):
        return 2 * (1 - np.minimum(x / CUT, 1) ** 2) ** 2
