"""What all mesh documents return besides vertices and faces: attributes for other formats, and bytes with other positions."""

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True, eq=False)
class Attributes:
    """What a mesh has besides its geometry, for a file of another format.

    Attributes:
        colors: (n, 3 or 4) uint8, RGB or RGBA of the vertices, or None.
        face_colors: (m, 3 or 4) uint8, RGB or RGBA of the triangles, or None.
        vertex_uv: (n, 2) float, texture coordinates of the vertices, origin at the bottom left, or None.
        corner_uv: (m, 3, 2) float, texture coordinates of the triangles' corners, origin at the bottom left, or None.
        has_normals: whether the vertices have normals.
    """

    colors: np.ndarray | None = None
    face_colors: np.ndarray | None = None
    vertex_uv: np.ndarray | None = None
    corner_uv: np.ndarray | None = None
    has_normals: bool = False


@dataclass(frozen=True, eq=False)
class MovedMesh:
    """The bytes of a document with other positions.

    Attributes:
        files: names of the files beside the mesh that the bytes refer to, as they are written there.
    """

    data: bytes
    files: tuple[str, ...] = field(default=())


def as_bytes(colors: np.ndarray) -> np.ndarray:
    """Colours as uint8: of fractions from 0 to 1 if none is larger, else of numbers from 0 to 255.

    Args:
        colors: float or int; whole numbers are never fractions.
    """
    colors = np.nan_to_num(np.clip(colors, 0, 255))
    are_fractions = colors.dtype.kind == "f" and colors.max(initial=0) <= 1
    return np.rint(colors * 255 if are_fractions else colors).astype(np.uint8)
