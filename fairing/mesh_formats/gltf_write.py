"""GLB with new positions: data is appended, and everything that the file has is kept."""

import copy
import json
import struct
from typing import Any
from urllib.parse import unquote

import numpy as np

from fairing.errors import InputError
from fairing.mesh_formats.document import MovedMesh
from fairing.mesh_formats.gltf_file import GltfFile
from fairing.mesh_formats.gltf_part import Part
from fairing.mesh_formats.vertex_normals import moved_normals

_DRACO = "KHR_draco_mesh_compression"
_FLOAT, _VERTEX_DATA = 5126, 34962


def moved_glb(file: GltfFile, parts: list[Part], vertices: np.ndarray) -> MovedMesh:
    """A GLB of the file's content with vertices (n, 3) float of all parts, world units.

    Positions, normals and tangents are new accessors in single precision. A mesh that several nodes show becomes one for each,
    because its copies have moved apart. Buffers in files become part of the GLB; images in files keep their names.

    Raises:
        InputError: a node's scale is zero, or a buffer cannot be read.
    """
    content = copy.deepcopy(file.content.value)
    chunk = _Chunk(file, content)
    owners: dict[int, int] = {}
    for node in dict.fromkeys(part.node for part in parts):
        of_node = [part for part in parts if part.node == node]
        for mesh in dict.fromkeys(part.mesh for part in of_node):
            target = mesh
            if owners.setdefault(mesh, node) != node:
                target = len(content["meshes"])
                content["meshes"].append(copy.deepcopy(file.content.value["meshes"][mesh]))
                content["nodes"][node]["mesh"] = target
            for part in of_node:
                if part.mesh == mesh:
                    _move(file, part, vertices[part.vertices], content["meshes"][target]["primitives"], chunk)
    images = tuple(
        unquote(image.text("uri"))
        for image in file.content.children("images")
        if "uri" in image and not image.text("uri").startswith("data:")
    )
    return MovedMesh(chunk.glb(), images)


def _move(file: GltfFile, part: Part, vertices: np.ndarray, primitives: list[dict[str, Any]], chunk: "_Chunk") -> None:
    """Give the primitives of a part new positions, and new normals and tangents where they have some."""
    try:
        part_from_world = np.linalg.inv(part.world_from_part)
    except np.linalg.LinAlgError:
        raise InputError(
            f"nodes[{part.node}]: expected a scale that is not zero; apply the transforms and export again"
        ) from None
    positions = vertices @ part_from_world[:3, :3].T + part_from_world[:3, 3]
    position_accessor = chunk.add(positions, with_bounds=True)
    new: dict[tuple[int, int], tuple[int, int]] = {}
    for i in part.primitives:
        attributes = primitives[i]["attributes"]
        primitives[i].get("extensions", {}).pop(_DRACO, None)
        attributes["POSITION"] = position_accessor
        if "NORMAL" not in attributes:
            continue
        old, old_tangents = attributes["NORMAL"], attributes.get("TANGENT", -1)
        if (old, old_tangents) not in new:
            before = file.accessor(old).astype(np.float64)
            normals = moved_normals(part.positions, positions, part.all_faces(), before)
            tangents = _tangents(file.accessor(old_tangents), normals) if old_tangents >= 0 else None
            new[old, old_tangents] = chunk.add(normals), -1 if tangents is None else chunk.add(tangents)
        attributes["NORMAL"], new_tangents = new[old, old_tangents]
        if old_tangents >= 0:
            attributes["TANGENT"] = new_tangents


def _tangents(tangents: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Tangents (n, 4) float made perpendicular to new normals; the fourth number is kept."""
    along = tangents[:, :3] - normals * (tangents[:, :3] * normals).sum(1, keepdims=True)
    length = np.linalg.norm(along, axis=1, keepdims=True)
    along = np.where(length > 1e-6, along / np.maximum(length, 1e-6), tangents[:, :3])
    return np.column_stack([along, tangents[:, 3:]])


class _Chunk:
    """The binary chunk: the file's buffers one after the other, then what is added."""

    def __init__(self, file: GltfFile, content: dict[str, Any]) -> None:
        self._content, self._parts, self._size = content, [], 0
        starts = []
        for i in range(len(content.get("buffers", []))):
            starts.append(self._size)
            self._append(file.buffer(i))
        for view in content.setdefault("bufferViews", []):
            view["byteOffset"] = starts[view["buffer"]] + view.get("byteOffset", 0)
            view["buffer"] = 0

    def add(self, values: np.ndarray, with_bounds: bool = False) -> int:
        """Append values (n, 3) or (n, 4) in single precision; returns the index of their accessor."""
        values = values.astype("<f4")
        accessor: dict[str, Any] = {
            "bufferView": len(self._content["bufferViews"]), "componentType": _FLOAT, "count": len(values),
            "type": f"VEC{values.shape[1]}",
        }  # fmt: skip
        if with_bounds:
            accessor |= {"min": values.min(0).tolist(), "max": values.max(0).tolist()}
        view = {"buffer": 0, "byteOffset": self._size, "byteLength": values.nbytes, "target": _VERTEX_DATA}
        self._content["bufferViews"].append(view)
        self._content["accessors"].append(accessor)
        self._append(values.tobytes())
        return len(self._content["accessors"]) - 1

    def glb(self) -> bytes:
        self._content["buffers"] = [{"byteLength": self._size}]
        text = json.dumps(self._content, separators=(",", ":"), ensure_ascii=False).encode()
        text += b" " * (-len(text) % 4)
        total = 12 + 8 + len(text) + 8 + self._size
        head = struct.pack("<4sII", b"glTF", 2, total) + struct.pack("<I4s", len(text), b"JSON")
        return b"".join([head, text, struct.pack("<I4s", self._size, b"BIN\0"), *self._parts])

    def _append(self, data: bytes) -> None:
        padded = bytes(data) + b"\0" * (-len(data) % 4)
        self._parts.append(padded)
        self._size += len(padded)
