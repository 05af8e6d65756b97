"""Reading scenes and meshes, writing results; a file per format."""

from fairing.io.load import load_scene, read_capture
from fairing.io.mesh_file import read_mesh, write_mesh

__all__ = ["load_scene", "read_capture", "read_mesh", "write_mesh"]
