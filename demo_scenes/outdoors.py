"""Buildings in the street: their materials, the ground before them, sun and sky."""

import os
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from demo_scenes.materials import rubble
from demo_scenes.photography import GLOSS_LEVELS, Photography
from demo_scenes.sheet import Sheet
from demo_scenes.surface import PaintedSurface, Stage, painted

SUN = np.array([-0.45, 0.62, 0.64])
LIGHT_STEPS = 28


@dataclass(frozen=True)
class Coat:
    """A texture on demand and its scale.

    Attributes:
        paint: makes the (n, n, 3) texture in grey levels.
        density: texels per metre (or per unit, where the sheet's texture coordinates have one).
    """

    paint: Callable[[], np.ndarray]
    density: float


def outdoor_stage(sheet: Sheet, coats: Mapping[str, Coat], photography: Photography) -> Stage:
    """A building on a cobbled ground under an afternoon sun.

    Args:
        coats: one for each material name of the sheet.
    """
    return Stage(
        clothed(sheet, coats).joined(_ground(sheet.vertices)),
        sun_direction=SUN / np.linalg.norm(SUN),
        sun_color=np.array([0.86, 0.80, 0.70]),
        sky_color=np.array([0.46, 0.50, 0.57]),
        background=np.array([[196.0, 206.0, 216.0], [104.0, 142.0, 196.0]]),
        up=np.array([0, 1.0, 0]),
        light_steps=LIGHT_STEPS,
        gloss=GLOSS_LEVELS if photography.gloss else 0.0,
    )


def clothed(sheet: Sheet, coats: Mapping[str, Coat]) -> PaintedSurface:
    """The sheet's triangles with their materials painted."""
    names = sorted(set(sheet.material_of_face))
    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        textures = list(pool.map(lambda name: painted(coats[name].paint()), names))
    texture_of_face = np.array([names.index(name) for name in sheet.material_of_face])
    density = np.array([coats[name].density for name in names])
    texel = sheet.texture_metres * density[texture_of_face][:, None, None]
    return PaintedSurface.flat(sheet.vertices, sheet.faces, texture_of_face, texel, textures)


def _ground(building: np.ndarray, reach: float = 9.0) -> PaintedSurface:
    """Cobbles from just behind the building's front to `reach` metres before it and beside it."""
    left, right = building[:, 0].min() - reach, building[:, 0].max() + reach
    return floor_tiles(
        (left, right), (-1.2, reach), 0.0, 1.0, painted(rubble(768, 6.0, 90, (128, 122, 112), 0.13)), 128.0
    )


def floor_tiles(
    x_range: tuple[float, float],
    z_range: tuple[float, float],
    y: float,
    tile: float,
    texture: np.ndarray,
    density: float,
) -> PaintedSurface:
    """A level floor cut into tiles, as the rasteriser leaves out whole faces that reach behind a camera."""
    x, z = (np.linspace(low, high, round((high - low) / tile) + 1) for low, high in (x_range, z_range))
    column, row = (k.ravel() for k in np.meshgrid(np.arange(len(x) - 1), np.arange(len(z) - 1)))
    a = row * len(x) + column
    b, c, d = a + 1, a + 1 + len(x), a + len(x)
    faces = np.vstack([np.column_stack([a, d, c]), np.column_stack([a, c, b])])
    X, Z = (k.ravel() for k in np.meshgrid(x, z))
    vertices = np.column_stack([X, np.full_like(X, y), Z])
    texel = vertices[:, [0, 2]][faces] * density
    return PaintedSurface.flat(vertices, faces, np.zeros(len(faces), int), texel, [texture])
