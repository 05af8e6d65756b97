"""Mesh files: vertices and triangles in the file's order, and meshes written with everything that another file has."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np

from fairing.errors import InputError
from fairing.io.atomic import write_atomically
from fairing.io.capture import naming, reading
from fairing.io.neighbours import Neighbours, copy_neighbours
from fairing.mesh_formats.document import Attributes, MovedMesh
from fairing.mesh_formats.obj import write_obj
from fairing.mesh_formats.parse import MeshDocument, parse_mesh
from fairing.mesh_formats.ply import write_ply
from fairing.mesh_formats.ply_header import LONGEST_HEADER, parse_header

MESH_SUFFIXES = frozenset({".ply", ".obj", ".off", ".stl", ".glb", ".gltf"})
LARGEST_FILE = 1 << 32
"""Bytes of a mesh file."""
_OBJ_FACE = re.compile(rb"^[ \t]*fo?[ \t]", re.MULTILINE)


def read_mesh(path: str | Path) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) float, world units, and triangles (m, 3) int of a PLY, OBJ, OFF, STL, GLB or GLTF file.

    Polygons are triangulated, concave ones by ear clipping. The parts of a GLB are transformed and merged. Coordinates and
    indices are not checked; `Mesh` validates them.

    Raises:
        InputError: no such file, another format, damaged, or without faces.
    """
    path = Path(path)
    document = read_document(path, "a mesh", MESH_SUFFIXES)
    with naming(path):
        vertices, faces = document.vertices, document.faces
    if len(faces) == 0:
        raise InputError(f"{path}: expected a triangle mesh, found no faces; if it is a point cloud, mesh it first")
    return vertices, faces


def read_document(path: Path, expected: str, suffixes: frozenset[str]) -> MeshDocument:
    """The content of a mesh file, of one of the formats. `expected` is the kind of file for messages, such as "a mesh".

    Raises:
        InputError: no such file, another format, or damaged.
    """
    suffix = path.suffix.lower()
    if suffix not in suffixes:
        raise InputError(
            f"{path}: expected {expected} ({', '.join(sorted(suffixes))}), found {path.suffix or 'no suffix'}"
        )
    with reading(path, expected):
        if path.stat().st_size > LARGEST_FILE:
            raise InputError(f"{path}: expected {expected} of at most {LARGEST_FILE >> 30} GiB, found a larger file")
        data = path.read_bytes()
    with naming(path):
        return parse_mesh(suffix, data, Neighbours(path).read)


def has_faces(path: Path) -> bool:
    """Whether a mesh file has faces, judged without reading all of it where that is possible; True if it is damaged.

    A PLY without faces is a point cloud, as reconstruction programs write them beside the mesh.
    """
    suffix = path.suffix.lower()
    if suffix not in (".ply", ".obj"):
        return True
    try:
        with reading(path, "a mesh"), path.open("rb") as file:
            if suffix == ".obj":
                return _OBJ_FACE.search(file.read(LARGEST_FILE)) is not None
            header = parse_header(file.read(LONGEST_HEADER))
    except InputError:
        return True
    return any(element.count for element in header.elements if element.name in ("face", "tristrips"))


def write_mesh(
    path: str | Path, vertices: np.ndarray, faces: np.ndarray, like: str | Path | None = None
) -> tuple[Path, ...]:
    """Write vertices (n, 3), world units, and faces (m, 3) as PLY (binary, double precision) or OBJ, without loss.

    An existing file is replaced only once the new one is complete.

    Args:
        like: the mesh file that the faces were read from, whose attributes are kept. A file of its format has all of them:
            colours, texture coordinates, materials, groups, polygons, comments, further elements; normals are computed anew.
            Images and materials that it refers to are copied. As PLY, the mesh has what `Attributes` lists. Where no vertex
            has moved, a file of its format is a copy.

    Returns:
        The files written, `path` first.

    Raises:
        InputError: another suffix, `like` cannot be read or has other faces, or the disk is full or not writable.
    """
    path = Path(path)
    if like is not None:
        return _write_like(path, vertices, faces, Path(like))
    writers: dict[str, Callable[[], bytes]] = {
        ".ply": lambda: write_ply(vertices, faces, Attributes()),
        ".obj": lambda: write_obj(vertices, faces),
    }
    if path.suffix.lower() not in writers:
        raise InputError(f"{path}: meshes are written as .ply or .obj, found {path.suffix or 'no suffix'}")
    data = writers[path.suffix.lower()]()
    write_atomically(path, lambda file: file.write(data))
    return (path,)


def own_suffix(like: Path) -> str:
    """The suffix of a file that keeps all attributes of a mesh file: its own, and .glb for .gltf."""
    return ".glb" if like.suffix.lower() == ".gltf" else like.suffix.lower()


def _write_like(path: Path, vertices: np.ndarray, faces: np.ndarray, like: Path) -> tuple[Path, ...]:
    document = read_document(like, "a mesh", MESH_SUFFIXES)
    suffix = path.suffix.lower()
    if suffix not in (own_suffix(like), ".ply"):
        raise InputError(
            f"{path}: a mesh like {like.name} is written as {own_suffix(like)} or .ply, found {path.suffix or 'no suffix'}"
        )
    with naming(like):
        if len(document.vertices) != len(vertices) or not np.array_equal(document.faces, faces):
            raise InputError(
                f"expected the mesh that was refined ({len(vertices)} vertices, {len(faces)} faces), found another one "
                f"({len(document.vertices)}, {len(document.faces)}); give the file as it was"
            )
        if suffix != own_suffix(like):
            moved = MovedMesh(write_ply(vertices, faces, document.attributes()))
        else:
            moved = document.moved(np.asarray(vertices, dtype=np.float64))
            if suffix == like.suffix.lower() and np.array_equal(vertices, document.vertices):
                moved = MovedMesh(like.read_bytes(), moved.files)
    write_atomically(path, lambda file: file.write(moved.data))
    return (path, *copy_neighbours(like, moved.files, path.parent))
