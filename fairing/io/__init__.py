"""Input and output: scenes, meshes, scans and textured models; one module per format."""

from typing import TYPE_CHECKING

from fairing.util.on_demand import on_demand

if TYPE_CHECKING:
    from fairing.io.atomic import write_atomically
    from fairing.io.in_view import check_mesh_in_view
    from fairing.io.load import load_scene, read_capture
    from fairing.io.mesh_file import read_mesh, write_mesh
    from fairing.io.output_folder import prepare_output_folder
    from fairing.io.photo_choice import PhotoChoice

__all__ = [
    "PhotoChoice",
    "check_mesh_in_view",
    "load_scene",
    "prepare_output_folder",
    "read_capture",
    "read_mesh",
    "write_atomically",
    "write_mesh",
]

__getattr__ = on_demand(
    __name__,
    {
        "PhotoChoice": "fairing.io.photo_choice",
        "check_mesh_in_view": "fairing.io.in_view",
        "load_scene": "fairing.io.load",
        "prepare_output_folder": "fairing.io.output_folder",
        "read_capture": "fairing.io.load",
        "read_mesh": "fairing.io.mesh_file",
        "write_atomically": "fairing.io.atomic",
        "write_mesh": "fairing.io.mesh_file",
    },
)
