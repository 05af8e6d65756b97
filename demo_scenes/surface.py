"""Textured triangles and their illumination: what the cameras see."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fairing.geometry.normals import unit_normals


@dataclass(frozen=True, eq=False)
class PaintedSurface:
    """Triangles with texture coordinates.

    Attributes:
        vertices: (n, 3) float, world units.
        faces: (m, 3) int, counter-clockwise seen from outside.
        texture_of_face: (m,) int, index into `textures`.
        texel: (m, 3, 2) float, texels: where each corner of each face lies in its texture (x right, y down, texel
            centres at integers). Textures repeat in both directions.
        textures: (h, w, 3) uint8 arrays, albedo in grey levels.
        normals: (m, 3, 3) float, unit normal at each corner of each face; differ inside a face only where the triangles
            approximate a curved surface.
    """

    vertices: np.ndarray
    faces: np.ndarray
    texture_of_face: np.ndarray
    texel: np.ndarray
    textures: tuple[np.ndarray, ...]
    normals: np.ndarray

    @classmethod
    def flat(
        cls,
        vertices: np.ndarray,
        faces: np.ndarray,
        texture_of_face: np.ndarray,
        texel: np.ndarray,
        textures: Sequence[np.ndarray],
    ) -> "PaintedSurface":
        """A surface of plane faces: every corner has its face's normal."""
        normals = np.repeat(unit_normals(vertices, faces)[0][:, None], 3, axis=1)
        return cls(vertices, faces, texture_of_face, texel, tuple(textures), normals)

    def joined(self, other: "PaintedSurface") -> "PaintedSurface":
        """Both surfaces as one; faces of `other` follow."""
        return PaintedSurface(
            np.vstack([self.vertices, other.vertices]),
            np.vstack([self.faces, other.faces + len(self.vertices)]),
            np.concatenate([self.texture_of_face, other.texture_of_face + len(self.textures)]),
            np.concatenate([self.texel, other.texel]),
            self.textures + other.textures,
            np.concatenate([self.normals, other.normals]),
        )


@dataclass(frozen=True, eq=False)
class Stage:
    """A surface with its sun and sky.

    Attributes:
        sun_direction: (3,) float, unit vector towards the sun.
        sun_color, sky_color: (3,) float, factors on the albedo under full sun at normal incidence and under the open
            sky.
        background: (2, 3) float, grey levels behind everything: at the horizon and straight up.
        up: (3,) float, unit vector.
        light_steps: samples of shadow and skylight along a face's edge; 1 when nothing casts shadows worth seeing.
        gloss: strength of the specular lobe in grey levels; 0 is Lambertian.
    """

    surface: PaintedSurface
    sun_direction: np.ndarray
    sun_color: np.ndarray
    sky_color: np.ndarray
    background: np.ndarray
    up: np.ndarray
    light_steps: int = 1
    gloss: float = 0.0


def painted(texture: np.ndarray) -> np.ndarray:
    """A texture (h, w, 3) float in grey levels, rounded to uint8."""
    return np.clip(np.rint(texture), 0, 255).astype(np.uint8)
