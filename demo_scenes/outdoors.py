"""Buildings outdoors: their materials, the ground in front of them, sun and sky, and views of them."""

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from demo_scenes.graphics import window
from demo_scenes.materials import rubble
from demo_scenes.photography import GLOSS_LEVELS, Photography, Progress, looking_at, take_photos
from demo_scenes.sheet import Sheet
from demo_scenes.surface import PaintedSurface, Stage, painted
from fairing.camera import Camera
from fairing.scene import View

UP = np.array([0, 1.0, 0])
SUN = np.array([-0.45, 0.62, 0.64])
LIGHT_STEPS = 28
SAMPLES = 2  # rays along the side of a pixel (ledger: rays of outdoor photos)


@dataclass(frozen=True)
class Coat:
    """A texture on demand and its scale.

    Attributes:
        paint: makes the (n, n, 3) texture in grey levels.
        density: texels per metre (or per unit, where the sheet's texture coordinates have one).
    """

    paint: Callable[[], np.ndarray]
    density: float


def building_views(
    name: str,
    sheet: Sheet,
    coats: Mapping[str, Coat],
    cameras: Sequence[Camera],
    photography: Photography,
    progress: Progress | None,
) -> tuple[View, ...]:
    """Photos of a building on its cobbled ground.

    Args:
        coats: one for each material name of the sheet.
    """
    return take_photos(
        name,
        cameras,
        lambda: outdoor_stage(clothed(sheet, coats).joined(_ground(sheet.vertices)), photography),
        sheet.vertices,
        photography,
        SAMPLES,
        progress,
    )


def outdoor_stage(
    surface: PaintedSurface, photography: Photography, sun: np.ndarray = SUN, light_steps: int = LIGHT_STEPS
) -> Stage:
    """A painted surface under the sun.

    Args:
        sun: (3,) float, direction towards the sun, any length.
        light_steps: samples of shadow and skylight along a face's edge.
    """
    return Stage(
        surface,
        sun_direction=sun / np.linalg.norm(sun),
        sun_color=np.array([0.86, 0.80, 0.70]),
        sky_color=np.array([0.46, 0.50, 0.57]),
        background=np.array([[196.0, 206.0, 216.0], [104.0, 142.0, 196.0]]),
        up=UP,
        light_steps=light_steps,
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


def window_coats(names: str, seed: int, n: int = 512) -> dict[str, Coat]:
    """Coats "window a", "window b", ... for the letters in `names`: (n, n, 3) textures stretched over a pane each."""
    return {f"window {name}": Coat(lambda k=k: window(n, seed=seed + k), n - 1.0) for k, name in enumerate(names)}


def camera_on_arc(
    distance: float,
    turn: float,
    height: float,
    target: Sequence[float],
    roll: float,
    focal_px: float,
    size: tuple[int, int],
) -> Camera:
    """A camera on an arc about the y axis, level but for `roll`.

    Args:
        distance: metres from the axis.
        turn: radians from the z axis to the right.
        height: metres above the ground.
        target: (3,), metres: what the photo's centre shows.
        size: width and height, pixels.
    """
    eye = np.array([distance * np.sin(turn), height, distance * np.cos(turn)])
    return looking_at(eye, np.array(target), UP, focal_px, *size, roll=roll)


def _ground(building: np.ndarray, reach: float = 9.0) -> PaintedSurface:
    """Cobbles from just behind the building's front to `reach` metres in front of it and beside it."""
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
    """A level floor of square tiles; the rasteriser omits whole faces that reach behind a camera."""
    vertices, faces = tile_grid(x_range, z_range, y, tile)
    texel = vertices[:, [0, 2]][faces] * density
    return PaintedSurface.flat(vertices, faces, np.zeros(len(faces), int), texel, [texture])


def tile_grid(
    x_range: tuple[float, float], z_range: tuple[float, float], y: float, tile: float
) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) and faces (m, 3) of a level floor of tiles about `tile` wide, facing up."""
    x, z = (np.linspace(low, high, round((high - low) / tile) + 1) for low, high in (x_range, z_range))
    column, row = (k.ravel() for k in np.meshgrid(np.arange(len(x) - 1), np.arange(len(z) - 1)))
    a = row * len(x) + column
    b, c, d = a + 1, a + 1 + len(x), a + len(x)
    faces = np.vstack([np.column_stack([a, d, c]), np.column_stack([a, c, b])])
    X, Z = (k.ravel() for k in np.meshgrid(x, z))
    return np.column_stack([X, np.full_like(X, y), Z]), faces
