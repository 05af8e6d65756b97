"""What `fair` writes into its folder."""

MESH, REPORT, TRACE = "mesh.ply", "report.json", "run.trace"
FLIPS = ".flips"
"""The ending of what `triangulate` writes beside its mesh: the record of flips."""
