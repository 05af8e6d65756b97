"""Energies, normal equations and constraints: what one step minimizes, and the limits of the step.

`energy` evaluates faces by the kernels, `problem` binds scene, options and photos, `normal_equations` solves for steps of
the photos beside other terms, `step_limits` keeps faces from folding, `blocks` and `locks` choose the vertices, `point_split`
says which sparse points fits use.

Imports the data modules of `fairing`, `fairing.geometry`, `fairing.cells`, `fairing.kernels` and `fairing.norms`.
"""
