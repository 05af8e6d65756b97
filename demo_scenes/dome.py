"""Demo scene `dome`: a curved surface with a dense texture; the vertices of its coarse mesh are off along its radii."""

import numpy as np

from demo_scenes.lighting import spread_over_cap
from demo_scenes.materials import ashlar, rubble
from demo_scenes.noise import seeded
from demo_scenes.outdoors import SUN, floor_tiles
from demo_scenes.photography import GLOSS_LEVELS, Photography, Progress, looking_at, take_photos
from demo_scenes.surface import PaintedSurface, Stage, painted
from fairing.camera import Camera
from fairing.mesh import Mesh
from fairing.scene import Scene, Truth

PHOTO_SIZE = (800, 600)
CAMERAS = 16
SAMPLES = 4
CAP = np.radians(72)  # from the crown to the rim
COARSE_RINGS, FINE_RINGS = 8, 96
START_ERROR = (0.004, 0.005)  # fractions of the diagonal
UP = np.array([0, 1.0, 0])


def dome_scene(photography: Photography | None = None, progress: Progress | None = None, start_seed: int = 1) -> Scene:
    """A cap of the unit sphere about the origin; the photos show a fine mesh of it.

    The chords of the fine mesh lie within 0.003 % of the diagonal of the sphere.

    Args:
        start_seed: seed of the start mesh; the photos do not depend on it.
    """
    photography = photography or Photography()
    fine, coarse = sphere_cap(FINE_RINGS), sphere_cap(COARSE_RINGS)
    cameras = dome_cameras()
    views = take_photos(
        "dome", cameras, lambda: _stage(fine, photography), coarse.vertices, photography, SAMPLES, progress
    )
    rng = seeded(start_seed, 34)
    n = len(coarse.vertices)
    off = rng.choice([-1.0, 1.0], n) * rng.uniform(*START_ERROR, n) * coarse.diagonal
    normals = [vertex[None] for vertex in coarse.vertices]
    start = coarse.vertices * (1 + off)[:, None]
    return Scene.build(
        "dome", start, coarse.faces, views, truth=Truth(fine, coarse.vertices, normals), points_choice="given"
    )


def sphere_cap(rings: int) -> Mesh:
    """A cap of the unit sphere about the y axis: ring r holds 6 r vertices, so that all triangles have nearly the same shape."""
    vertices = [UP]
    faces = []
    first = 1
    for r in range(1, rings + 1):
        polar = CAP * r / rings
        turn = 2 * np.pi * np.arange(6 * r) / (6 * r)
        ring = np.column_stack(
            [np.sin(polar) * np.sin(turn), np.full(6 * r, np.cos(polar)), np.sin(polar) * np.cos(turn)]
        )
        vertices.extend(ring)
        inner, inner_count = first - 6 * (r - 1), max(6 * (r - 1), 1)
        if r == 1:
            inner = 0
        for sector in range(6):
            for k in range(r):
                outer_a = first + sector * r + k
                outer_b = first + (sector * r + k + 1) % (6 * r)
                inner_a = inner + (sector * (r - 1) + k) % inner_count
                faces.append([inner_a, outer_a, outer_b])
                if k < r - 1:
                    inner_b = inner + (sector * (r - 1) + k + 1) % inner_count
                    faces.append([inner_a, outer_b, inner_b])
        first += 6 * r
    return Mesh(np.array(vertices), np.array(faces))


def dome_cameras() -> list[Camera]:
    """16 cameras 3.7 radii from the sphere's centre, from straight above down to 68 degrees from there."""
    width, height = PHOTO_SIZE
    cameras = []
    for k, direction in enumerate(spread_over_cap(UP, np.radians(70), CAMERAS)):
        eye = (3.7 + 0.15 * np.sin(2.3 * k)) * direction
        north = np.array([0, 0.2, -1.0]) if k < 2 else UP
        cameras.append(looking_at(eye, 0.55 * UP, north, 780, width, height, roll=0.1 * np.sin(3.7 * k)))
    return cameras


def _stage(fine: Mesh, photography: Photography) -> Stage:
    """The dome with an azimuthal equidistant texture, which has no seam, on paving."""
    n, density = 1400, 540.0  # texels per radius
    polar = np.arccos(np.clip(fine.vertices[:, 1], -1, 1))
    around = np.arctan2(fine.vertices[:, 0], fine.vertices[:, 2])
    flat = (polar * np.array([np.sin(around), np.cos(around)])).T
    texel = n / 2 + density * flat[fine.faces]
    texture = painted(rubble(n, 7.0, seed=50, tint=(168, 150, 128), stone=0.26))
    normals = fine.vertices[fine.faces]
    dome = PaintedSurface(fine.vertices, fine.faces, np.zeros(len(fine.faces), int), texel, (texture,), normals)
    paving = painted(ashlar(1024, 6.4, seed=51, tint=(150, 146, 138)))
    rim = float(np.cos(CAP))
    return Stage(
        dome.joined(floor_tiles((-4, 4), (-4, 4), rim - 1e-3, 0.5, paving, 320.0)),
        sun_direction=SUN / np.linalg.norm(SUN),
        sun_color=np.array([0.80, 0.76, 0.68]),
        sky_color=np.array([0.52, 0.55, 0.60]),
        background=np.array([[196.0, 206.0, 216.0], [104.0, 142.0, 196.0]]),
        up=UP,
        gloss=GLOSS_LEVELS if photography.gloss else 0.0,
    )
