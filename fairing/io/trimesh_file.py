"""Mesh and scan files read with trimesh, with limits on the files they refer to and on the sizes they declare.

A GLTF file names further files and may declare the same data many times. trimesh reads whatever is named in the folder, pipes
included, and allocates whatever is declared.
"""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import trimesh
from trimesh.resolvers import Resolver

from fairing.errors import InputError
from fairing.io.capture import reading

MAX_BYTES = 1 << 30
"""Of all files that one mesh file refers to, and of the data that it declares: some 50 million faces."""
_OPTIONS: dict[str, dict[str, Any]] = {suffix: {"skip_materials": True} for suffix in (".ply", ".obj", ".glb", ".gltf")}
_COMPONENT_BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
_COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_GLB_HEADER, _GLB_MAGIC = 20, b"glTF"


@contextmanager
def parsing(path: Path, expected: str) -> Iterator[None]:
    """Raises whatever trimesh's parsers raise as an InputError about this file.

    Damaged bytes make numpy, json or struct raise exceptions of any kind.
    """
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"{path}: expected {expected}, cannot be read ({reason:.200}); export it again") from None


def load_with_trimesh(path: Path, **options: Any) -> trimesh.Scene:
    """The contents of a mesh or scan file, without materials. Call within `parsing`.

    Args:
        options: of trimesh's reader.

    Raises:
        InputError: the file refers to a file outside its folder, to a pipe or device, or to too much data.
        Exception: the content is damaged.
    """
    suffix = path.suffix.lower()
    if suffix in (".glb", ".gltf"):
        _check_declared(path)
    return trimesh.load_scene(path, resolver=_Neighbours(path), process=False, **_OPTIONS.get(suffix, {}), **options)


class _Neighbours(Resolver):
    """The files that a mesh file refers to: regular files in its folder or below, at most `MAX_BYTES` in all."""

    def __init__(self, path: Path) -> None:
        self._path, self._bytes_left = path, MAX_BYTES

    def get(self, key: str) -> bytes:
        found = self._find(key)
        with reading(found, f"a file that {self._path.name} refers to"):
            size = found.stat().st_size
            if size > self._bytes_left:
                raise InputError(
                    f"{self._path}: expected references to at most {MAX_BYTES >> 20} MiB, found more with {found.name!r}; "
                    "export the mesh again"
                )
            self._bytes_left -= size
            return found.read_bytes()

    def _find(self, name: str) -> Path:
        """The file of this name, as it is or percent-encoded; of a path that leads elsewhere, the file beside the mesh."""
        folder = self._path.parent.resolve()
        for candidate in (unquote(name), name, name.rpartition("/")[2]):
            try:
                path = (folder / candidate).resolve()
                if path.is_relative_to(folder) and path.exists():
                    return path
            except (OSError, ValueError, RuntimeError):  # a name too long, with a NUL, or a loop of links
                continue
        raise InputError(
            f"{self._path}: expected the files it refers to in its folder, found no {name[:80]!r} there; copy it there"
        )

    def keys(self) -> list[str]:
        """No names: files are found by `get` alone."""
        return []

    def write(self, name: str, data: Any) -> None:
        raise NotImplementedError

    def namespaced(self, namespace: str) -> "Resolver":
        raise NotImplementedError


def _check_declared(path: Path) -> None:
    """Refuse a GLTF or GLB file that declares more than `MAX_BYTES` of data, every repetition counted.

    Raises:
        InputError: it does.
        Exception: the declarations are damaged.
    """
    header = _gltf_header(path)
    views = sum(_count(view["byteLength"]) for view in header.get("bufferViews", []))
    sizes = [
        _count(item["count"]) * _COMPONENTS[item["type"]] * _COMPONENT_BYTES[item["componentType"]]
        for item in header.get("accessors", [])
    ]
    meshes = [sum(_primitive_bytes(part, sizes) for part in mesh["primitives"]) for mesh in header.get("meshes", [])]
    nodes = header.get("nodes", [])
    placed = [child for node in (*nodes, *({"children": s.get("nodes", [])} for s in header.get("scenes", [])))
              for child in node.get("children", [])]  # fmt: skip
    instances = sum(meshes[nodes[child]["mesh"]] for child in placed if "mesh" in nodes[child])
    largest = max(views, sum(sizes), sum(meshes), instances)
    if largest > MAX_BYTES:
        raise InputError(
            f"{path}: expected at most {MAX_BYTES >> 20} MiB of declared data, found {float(largest >> 20):.3g} MiB; "
            "export the mesh again"
        )


def _gltf_header(path: Path) -> dict[str, Any]:
    with path.open("rb") as file:
        start = file.read(_GLB_HEADER)
        if start[:4] == _GLB_MAGIC:
            return json.loads(file.read(int(np.frombuffer(start, dtype="<u4")[3])))
        return json.loads(start + file.read())


def _primitive_bytes(primitive: dict[str, Any], sizes: list[int]) -> int:
    used = [*primitive["attributes"].values(), *([primitive["indices"]] if "indices" in primitive else [])]
    return sum(sizes[accessor] for accessor in used)


def _count(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise ValueError(f"a count of {value!r}")
    return value
