"""Energies, normal equations and constraints: what one step minimizes and how far it may move.

Holds the evaluator, the problem of a run, blocks of vertices, locks, step limits, priors and the fit to sparse points.
May import the data modules of `fairing`, `fairing.geometry`, `fairing.cells` and `fairing.kernels`.
"""
