"""Evaluation of runs and meshes: accuracy, certainty, reports, and displays of cells and flow.

What belongs here: computations on a run that do not change it. Accuracy against truth, sparse points and left-out photos
(`metrics`, `quantities`, `left_out`, `render`), the residual that compares all moments and runs (`comparable_residual`),
certainty of vertices (`certainty`, `cramer_rao`), the cells of a recorded moment (`inspect`), their flow (`flow`) and residuals
(`face_residuals`, and at every sample, see `texels`: `texel_residuals`, `texel_flow`), and the report of a run (`report`).
Meshes of any origin are compared in `mesh_comparison`.

May import: the data modules of `fairing`, `fairing.util`, `fairing.geometry`, `fairing.kernels`, `fairing.cells`,
`fairing.solve` and `fairing.run`.

Offers: `face_cells`, `quality_report`, `run_report`, `leave_one_out`, `Renderer`, `certainties`, `cramer_rao_covariance`,
`model_flow` and `optical_flow`, and per-face and per-vertex quantities for display.
"""
