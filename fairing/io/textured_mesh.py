"""Textured model files: GLB, OBJ with MTL and PNG, PLY with PNG."""

import io
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image

from fairing.errors import InputError
from fairing.io.atomic import write_atomically
from fairing.io.glb import write_glb
from fairing.texture import TexturedModel

JPEG_QUALITY = 95


def write_textured(path: Path, model: TexturedModel) -> list[Path]:
    """Write a textured model in the format of its suffix; GLB embeds its texture, the others reference a file.

    OBJ and PLY keep the vertices and faces of the mesh (texture coordinates belong to the faces' corners, in PLY as
    MeshLab and OpenMVS write them); GLB has one vertex per corner of each face, in single precision.

    Returns:
        The files written, `path` last. Each one is complete or unchanged.

    Raises:
        InputError: another suffix, or the disk is full or not writable.
    """
    check_textured_suffix(path)
    return _WRITERS[path.suffix.lower()](path, model)


def check_textured_suffix(path: Path) -> None:
    """Raises InputError unless textured models can be written in the format of this suffix."""
    if path.suffix.lower() not in _WRITERS:
        raise InputError(
            f"{path}: textured models are written as .glb, .obj or .ply, found {path.suffix or 'no suffix'}"
        )


def _write_glb(path: Path, model: TexturedModel) -> list[Path]:
    faces = np.arange(3 * len(model.faces)).reshape(-1, 3)
    image = _encoded(model.image, "JPEG", quality=JPEG_QUALITY, subsampling=0)
    binary = write_glb(model.vertices[model.faces].reshape(-1, 3), faces, model.uv.reshape(-1, 2), image)
    write_atomically(path, lambda file: file.write(binary))
    return [path]


def _write_obj(path: Path, model: TexturedModel) -> list[Path]:
    material, picture = path.with_suffix(".mtl"), path.with_suffix(".png")
    lines = [f"mtllib {material.name}", "usemtl photos"]
    lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in np.asarray(model.vertices, dtype=np.float64).tolist()]
    lines += [f"vt {u:.7f} {1 - v:.7f}" for u, v in model.uv.reshape(-1, 2).tolist()]
    for f, (a, b, c) in enumerate((model.faces + 1).tolist()):
        lines.append(f"f {a}/{3 * f + 1} {b}/{3 * f + 2} {c}/{3 * f + 3}")
    # Unlit: the texture holds the photos' colors.
    properties = f"newmtl photos\nKa 1 1 1\nKd 1 1 1\nKs 0 0 0\nillum 0\nmap_Kd {picture.name}\n"
    _write(picture, _encoded(model.image, "PNG"))
    _write(material, properties.encode())
    _write(path, ("\n".join(lines) + "\n").encode())
    return [picture, material, path]


def _write_ply(path: Path, model: TexturedModel) -> list[Path]:
    picture = path.with_suffix(".png")
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"comment TextureFile {picture.name}",
        f"element vertex {len(model.vertices)}",
        *(f"property double {axis}" for axis in "xyz"),
        f"element face {len(model.faces)}",
        "property list uchar int vertex_indices",
        "property list uchar float texcoord",
        "end_header",
    ]
    columns = [("count", "u1"), ("corners", "<i4", 3), ("uv_count", "u1"), ("uv", "<f4", 6)]
    triangles = np.empty(len(model.faces), dtype=columns)
    triangles["count"], triangles["corners"], triangles["uv_count"] = 3, model.faces, 6
    triangles["uv"] = (model.uv * (1, -1) + (0, 1)).reshape(-1, 6)
    vertices = np.ascontiguousarray(model.vertices, dtype="<f8")
    _write(picture, _encoded(model.image, "PNG"))
    _write(path, ("\n".join(header) + "\n").encode() + vertices.tobytes() + triangles.tobytes())
    return [picture, path]


def _write(path: Path, content: bytes) -> None:
    write_atomically(path, lambda file: file.write(content))


def _encoded(image: np.ndarray, format: str, **options: int) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(image).save(buffer, format=format, **options)
    return buffer.getvalue()


_WRITERS: dict[str, Callable[[Path, TexturedModel], list[Path]]] = {
    ".glb": _write_glb,
    ".obj": _write_obj,
    ".ply": _write_ply,
}
