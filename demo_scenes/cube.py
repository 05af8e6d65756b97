"""Demo scene `cube`, the paper's illustration: three faces of a unit cube that meet in a displaced corner A."""

import hashlib
from collections.abc import Sequence

import numpy as np

from demo_scenes.graphics import poster
from demo_scenes.lighting import spread_over_cap
from demo_scenes.materials import brick, planks
from demo_scenes.photography import GLOSS_LEVELS, Photography, Progress, looking_at, take_photos
from demo_scenes.start import faceted_truth
from demo_scenes.surface import PaintedSurface, Stage, painted
from fairing.camera import Camera
from fairing.scene import Scene

# Vertex 0 is A; all six triangles contain it. Two triangles a square: z = 1, x = 1, y = 1, in this order.
VERTICES = np.array([[1, 1, 1], [0, 1, 1], [0, 0, 1], [1, 0, 1], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
FACES = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5], [0, 5, 6], [0, 6, 1]])
# Texture coordinates (right, down) of those triangles' corners on their square, in units of its side.
_CORNERS = np.array([[[0, 1], [0, 0], [1, 0]], [[0, 1], [1, 0], [1, 1]]], float)
_ON_SIDE = np.array([[[1, 0], [0, 0], [0, 1]], [[1, 0], [0, 1], [1, 1]]], float)
_ON_OTHER_SIDE = np.array([[[0, 0], [0, 1], [1, 1]], [[0, 0], [1, 1], [1, 0]]], float)
TEXTURE_CORNERS = np.concatenate([_CORNERS, _ON_SIDE, _ON_OTHER_SIDE])

DEFAULT_DISPLACEMENT = np.array([0.085, -0.055, 0.07])  # 12 % of the edge
PHOTO_SIZE = (640, 480)
CAMERAS = 12
SAMPLES = 8
TEXTURE_SIZE = 1024  # texels along an edge: seven a photo pixel


def cube_scene(
    photography: Photography | None = None,
    progress: Progress | None = None,
    displacement: np.ndarray = DEFAULT_DISPLACEMENT,
    textures: Sequence[np.ndarray] | None = None,
) -> Scene:
    """The cube with corner A (vertex 0) displaced.

    Args:
        displacement: (3,) float, edges: start minus true position of A. The photos do not depend on it.
        textures: three (h, w, 3) or (h, w) arrays in grey levels for the sides z = 1, x = 1 and y = 1 instead of the
            painted ones.
    """
    photography = photography or Photography()
    sides = None if textures is None else [_as_rgb(texture) for texture in textures]
    variant = "" if sides is None else hashlib.sha256(b"".join(side.tobytes() for side in sides)).hexdigest()
    cameras = cube_cameras()
    views = take_photos(
        "cube", cameras, lambda: cube_stage(sides, photography), VERTICES, photography, SAMPLES, progress, variant
    )
    start = VERTICES.copy()
    start[0] += displacement
    return Scene.build("cube", start, FACES, views, truth=faceted_truth(VERTICES, FACES), points_choice="given")


def cube_cameras() -> list[Camera]:
    """12 cameras about 4 edges from A, within 18 degrees of the cube's diagonal."""
    diagonal = np.ones(3) / np.sqrt(3)
    width, height = PHOTO_SIZE
    cameras = []
    for k, direction in enumerate(spread_over_cap(diagonal, np.radians(18), CAMERAS)):
        target = np.full(3, 0.66)
        eye = VERTICES[0] + (4 + 0.2 * np.sin(2.4 * k)) * direction
        cameras.append(looking_at(eye, target, np.array([0, 0, 1.0]), 820, width, height, roll=0.15 * np.sin(1.7 * k)))
    return cameras


def cube_stage(sides: list[np.ndarray] | None, photography: Photography) -> Stage:
    """The cube on a dark ground; `sides` are textures of z = 1, x = 1 and y = 1, None for the painted ones."""
    if sides is None:
        n = TEXTURE_SIZE
        sides = [painted(planks(n, 1.1, seed=3)), painted(brick(n, 1.2, seed=1)), painted(poster(n, seed=2))]
    texture_of_face = np.repeat([0, 1, 2], 2)
    # Sides end at texel centres, so that a repeating texture does not bleed in from its other end.
    extent = np.array([(side.shape[1] - 1, side.shape[0] - 1) for side in sides], float)
    texel = TEXTURE_CORNERS * extent[texture_of_face][:, None]
    sun = np.array([0.62, 0.42, 0.66])
    return Stage(
        PaintedSurface.flat(VERTICES, FACES, texture_of_face, texel, sides),
        sun_direction=sun / np.linalg.norm(sun),
        sun_color=np.array([0.92, 0.88, 0.80]),
        sky_color=np.array([0.46, 0.48, 0.52]),
        background=np.array([[38.0, 42.0, 50.0], [20.0, 23.0, 30.0]]),
        up=np.array([0, 0, 1.0]),
        gloss=GLOSS_LEVELS if photography.gloss else 0.0,
    )


def _as_rgb(texture: np.ndarray) -> np.ndarray:
    texture = texture if texture.ndim == 3 else np.repeat(texture[..., None], 3, axis=2)
    return np.ascontiguousarray(painted(texture[..., :3].astype(float)))
