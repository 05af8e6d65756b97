"""What `fair` writes into its folder."""

MESH, REPORT, TRACE = "mesh.ply", "report.json", "run.trace"
MODEL, MODEL_BEFORE, LEFT_OUT = "model.glb", "model_before.glb", "left_out.png"
FLIPS = ".flips"
"""The ending of what `triangulate` writes beside its mesh: the record of flips."""
