"""Cells: the samples of each face in each photo that the engine compares.

Holds visibility, blurred photos (scale space), the common point spread function, and `CellContext`, which combines
them for one level. May import the data modules of `fairing`, `fairing.geometry` and `fairing.kernels`.
"""
