"""Judgements of a run: metrics, reports, certainty, and views into cells and flow.

Nothing here changes a run. May import the data modules of `fairing`, `fairing.geometry`, `fairing.cells`,
`fairing.kernels`, `fairing.solve`, `fairing.run` and `fairing.util`.
"""
