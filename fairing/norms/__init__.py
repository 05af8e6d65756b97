"""Norms: the robust loss rho of the residuals of photos, and the weights rho'(e) / e that follow from it.

`norm` describes what a norm is, for those of one's own too, and tabulates its functions for the kernels; `built_in` has the
norms of the options, one class each. Imports the data modules of `fairing` and `fairing.kernels`.
"""
