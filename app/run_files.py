"""What `fair` writes into its folder."""

MESH, REPORT, TRACE = "mesh.ply", "report.json", "run.trace"
