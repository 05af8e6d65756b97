"""Names of the files in an output folder."""

MESH, REPORT, TRACE = "mesh.ply", "report.json", "run.trace"
MODEL, MODEL_BEFORE, LEFT_OUT = "model.glb", "model_before.glb", "left_out.png"
FLIPS = ".flips"
"""Suffix of the record of flips that `triangulate` writes beside its mesh."""
POINTS = ".points.npz"
"""Suffix of the sparse points found in the photos, beside the trace or the record of flips that they were used for."""
