"""Parsing of a mesh file by its suffix.

Every document has `vertices` (n, 3) float, world units; `faces` (m, 3) int, unchecked, m = 0 for a point cloud; `attributes()`,
what files of another format can hold; and `moved(vertices)`, the same content with other vertices (n, 3) float and, if there
are normals, new ones.
"""

from collections.abc import Callable

from fairing.mesh_formats.gltf import GltfDocument, parse_gltf
from fairing.mesh_formats.obj import ObjDocument, parse_obj
from fairing.mesh_formats.off import OffDocument, parse_off
from fairing.mesh_formats.ply import PlyDocument, parse_ply
from fairing.mesh_formats.stl import StlDocument, parse_stl

MeshDocument = PlyDocument | ObjDocument | OffDocument | StlDocument | GltfDocument
_PARSERS: dict[str, Callable[[bytes], MeshDocument]] = {
    ".ply": parse_ply, ".obj": parse_obj, ".off": parse_off, ".stl": parse_stl
}  # fmt: skip


def parse_mesh(suffix: str, data: bytes, resolve: Callable[[str], bytes]) -> MeshDocument:
    """The content of a mesh file.

    Args:
        suffix: of the file, lower case; one that is none of the others is taken for glTF.
        resolve: returns the bytes of a file that a glTF refers to, by its URI.

    Raises:
        InputError: the content is damaged or not supported.
    """
    parse = _PARSERS.get(suffix)
    return parse_gltf(data, resolve) if parse is None else parse(data)
