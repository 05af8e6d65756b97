"""Binary glTF (GLB) writer for one unlit, textured triangle mesh."""

import json
import struct
from typing import Any

import numpy as np


def write_glb(vertices: np.ndarray, faces: np.ndarray, uv: np.ndarray, image: bytes, mime: str = "image/jpeg") -> bytes:
    """A GLB file of a mesh that is shown in the texture's colors, without lighting.

    Coordinates are stored relative to the middle of the mesh, which becomes the node's translation, because glTF has
    single precision only.

    Args:
        vertices: (n, 3) float, world units.
        faces: (m, 3) int, indices into `vertices`.
        uv: (n, 2) float, texture coordinates in 0 to 1, origin at the image's top left.
        image: the encoded texture.
        mime: the texture's media type.
    """
    vertices = np.asarray(vertices, dtype=np.float64)
    middle = (vertices.min(0) + vertices.max(0)) / 2
    positions = (vertices - middle).astype("<f4")
    parts = [
        positions.tobytes(),
        np.ascontiguousarray(uv, dtype="<f4").tobytes(),
        np.ascontiguousarray(faces, dtype="<u4").tobytes(),
        image,
    ]
    views, offset = [], 0
    for part in parts:
        views.append({"buffer": 0, "byteOffset": offset, "byteLength": len(part)})
        offset += len(part) + (-len(part)) % 4
    binary = b"".join(part + b"\0" * ((-len(part)) % 4) for part in parts)
    document: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "EigenFairing"},
        "extensionsUsed": ["KHR_materials_unlit"],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "translation": middle.tolist()}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}]}],
        "materials": [
            {
                "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0.0},
                "extensions": {"KHR_materials_unlit": {}},
                "doubleSided": True,
            }
        ],
        "textures": [{"source": 0, "sampler": 0}],
        "samplers": [{"magFilter": 9729, "minFilter": 9729, "wrapS": 33071, "wrapT": 33071}],
        "images": [{"bufferView": 3, "mimeType": mime}],
        "accessors": [
            {
                "bufferView": 0,
                "componentType": 5126,
                "count": len(positions),
                "type": "VEC3",
                "min": positions.min(0).tolist(),
                "max": positions.max(0).tolist(),
            },
            {"bufferView": 1, "componentType": 5126, "count": len(positions), "type": "VEC2"},
            {"bufferView": 2, "componentType": 5125, "count": int(np.size(faces)), "type": "SCALAR"},
        ],
        "bufferViews": views,
        "buffers": [{"byteLength": len(binary)}],
    }
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * ((-len(text)) % 4)
    total = 12 + 8 + len(text) + 8 + len(binary)
    return b"".join(
        [
            struct.pack("<4sII", b"glTF", 2, total),
            struct.pack("<I4s", len(text), b"JSON"),
            text,
            struct.pack("<I4s", len(binary), b"BIN\0"),
            binary,
        ]
    )
