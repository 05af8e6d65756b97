"""Compiled loops over faces: sample the cells, fit the eigenspace, weigh the residual, build the normal equations.

What belongs here: everything that runs per sample during fairing, compiled by numba. `faces` holds the two entry points; `data`
their fixed input; `sampling`, `interpolation`, `eigenspace`, `robust`, `normal_equations` and `rows` the steps; `compiled` the
compiler settings.

May import: `fairing.util` and numpy, numba, llvmlite; no other part of `fairing`.

Offers: `fairing.kernels.faces.evaluate_faces` (energies and normal equations), `show_face` (one face with all intermediate
results), `fairing.kernels.data.KernelData`.
"""
