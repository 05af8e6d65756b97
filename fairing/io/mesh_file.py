"""Mesh files: vertices and triangles, in the file's order.

OBJ has a reader of its own: trimesh splits the vertices of a textured OBJ where texture coordinates differ and drops
unused ones, but the written mesh must have the vertices of the mesh read.
"""

from itertools import pairwise
from pathlib import Path
from typing import BinaryIO

import numpy as np

from fairing.errors import InputError
from fairing.io.atomic import write_atomically
from fairing.io.capture import read_text, reading
from fairing.io.trimesh_file import load_with_trimesh, parsing

_LARGEST_INDEX = 1 << 40
MESH_SUFFIXES = frozenset({".ply", ".obj", ".off", ".stl", ".glb", ".gltf"})


def read_mesh(path: str | Path) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) float, world units, and triangles (m, 3) int of a PLY, OBJ, OFF, STL, GLB or GLTF file.

    Polygons are triangulated. The parts of a GLB are transformed and merged. Coordinates and indices are not checked;
    `Mesh` validates them.

    Raises:
        InputError: no such file, another format, damaged, or without faces.
    """
    path = Path(path)
    if path.suffix.lower() not in MESH_SUFFIXES:
        raise InputError(
            f"{path}: expected a mesh ({', '.join(sorted(MESH_SUFFIXES))}), found {path.suffix or 'no suffix'}"
        )
    with reading(path, "a mesh"), path.open("rb"):
        pass
    vertices, faces = _read_obj(path) if path.suffix.lower() == ".obj" else _read_with_trimesh(path)
    if len(faces) == 0:
        raise InputError(f"{path}: expected a triangle mesh, found no faces; if it is a point cloud, mesh it first")
    return vertices, faces


def write_mesh(path: str | Path, vertices: np.ndarray, faces: np.ndarray) -> None:
    """Write vertices (n, 3), world units, and faces (m, 3) as PLY (binary, double precision) or OBJ, without loss.

    An existing file is replaced only once the new one is complete.

    Raises:
        InputError: another suffix, or the disk is full or not writable.
    """
    path, writers = Path(path), {".ply": _write_ply, ".obj": _write_obj}
    if path.suffix.lower() not in writers:
        raise InputError(f"{path}: meshes are written as .ply or .obj, found {path.suffix or 'no suffix'}")
    write_atomically(path, lambda file: writers[path.suffix.lower()](file, vertices, faces))


def _read_with_trimesh(path: Path) -> tuple[np.ndarray, np.ndarray]:
    # Otherwise trimesh splits the vertices of a textured PLY.
    options = {"fix_texture": False} if path.suffix.lower() == ".ply" else {}
    with parsing(path, "a mesh"):
        mesh = load_with_trimesh(path, **options).to_mesh()
        return np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64)


def _read_obj(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Lines `v x y z` and `f a b c ...`; of `a/b/c` only the vertex index a is used, from 1, or backwards from -1."""
    vertices: list[list[float]] = []
    faces: list[list[int]] = []
    for number, line in enumerate(read_text(path, "a mesh").splitlines(), start=1):
        fields = line.split()
        try:
            if fields[:1] == ["v"]:
                x, y, z = fields[1:4]
                vertices.append([float(x), float(y), float(z)])
            elif fields[:1] == ["f"]:
                corners = [int(field.split("/")[0]) for field in fields[1:]]
                if len(corners) < 3 or 0 in corners or max(map(abs, corners)) > _LARGEST_INDEX:
                    raise ValueError("not a polygon")
                corners = [corner - 1 if corner > 0 else len(vertices) + corner for corner in corners]
                faces.extend([corners[0], b, c] for b, c in pairwise(corners[1:]))
        except ValueError:
            raise InputError(f"{path}: line {number}: expected `v x y z` or `f a b c`, found {line[:60]!r}") from None
    return np.array(vertices, dtype=np.float64).reshape(-1, 3), np.array(faces, dtype=np.int64).reshape(-1, 3)


def _write_ply(file: BinaryIO, vertices: np.ndarray, faces: np.ndarray) -> None:
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {len(vertices)}",
        *(f"property double {axis}" for axis in "xyz"),
        f"element face {len(faces)}",
        "property list uchar int vertex_indices",
        "end_header",
    ]
    triangles = np.empty(len(faces), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    triangles["count"], triangles["corners"] = 3, faces
    file.write(("\n".join(header) + "\n").encode())
    file.write(np.ascontiguousarray(vertices, dtype="<f8").tobytes())
    file.write(triangles.tobytes())


def _write_obj(file: BinaryIO, vertices: np.ndarray, faces: np.ndarray) -> None:
    # repr of a float is the shortest text that reads back as the same float.
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in np.asarray(vertices, dtype=np.float64).tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (np.asarray(faces) + 1).tolist()]
    file.write(("\n".join(lines) + "\n").encode())
