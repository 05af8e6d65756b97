"""Sunlight with soft shadows and skylight with ambient occlusion, as functions of position alone.

Both are sampled on a barycentric lattice of every face and interpolated between, so that all photos of a Lambertian
surface see the same light, and coplanar neighbours agree along their common edge. Shadows come from depth maps: the scene
is rasterised from far away in each direction of the sky.
"""

import numpy as np
from numba import njit

from demo_scenes.surface import PaintedSurface, Stage
from fairing.camera import Camera
from fairing.geometry.rasterize import rasterize

MAP_SIZE = 1024
SKY_DIRECTIONS = 40
SUN_DIRECTIONS = 12
SUN_RADIUS = 0.03  # radians: larger than the real sun's 0.0047, for shadow borders a few photo pixels wide
LIFT = 0.004  # fraction of the scene's radius by which samples are lifted off their face, against self-shadowing


def light_lattice(stage: Stage) -> np.ndarray:
    """Light on every face: (m, steps + 1, steps + 1, 2) float, sun visibility and sky visibility, 0 to 1.

    Entry [f, i, j] is the point with barycentric weights i / steps on the second corner and j / steps on the third;
    entries with i + j = steps + 1 repeat their face's border, and those beyond are not used. Without shadows (`light_steps`
    1) all is 1.
    """
    steps = stage.light_steps
    surface = stage.surface
    light = np.ones((len(surface.faces), steps + 1, steps + 1, 2))
    if steps == 1:
        return light
    i, j = (k.ravel() for k in np.mgrid[0 : steps + 1, 0 : steps + 1])
    is_used = i + j <= steps + 1
    places, normals = _lattice(surface, steps, i[is_used], j[is_used])
    low, high = surface.vertices.min(axis=0), surface.vertices.max(axis=0)
    center, radius = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
    lifted = places + LIFT * radius * normals
    sun, sky, open_sky = (np.zeros(len(places)) for _ in range(3))
    for direction in spread_over_cap(stage.sun_direction, SUN_RADIUS, SUN_DIRECTIONS):
        sun += _is_lit(surface, lifted, direction, center, radius)
    for direction in spread_over_cap(stage.up, np.pi / 2, SKY_DIRECTIONS):
        cosine = normals @ direction
        sky += np.maximum(cosine, 0) * _is_lit(surface, lifted, direction, center, radius)
        open_sky += np.abs(cosine)
    # Walls see half the sky; light reflected by the ground keeps everything above 0.42.
    sky = 0.42 + 0.58 * np.minimum(sky / (0.55 * open_sky), 1.3)
    shape = (len(light), np.count_nonzero(is_used))
    light.reshape(len(light), -1, 2)[:, is_used] = np.stack([sun / SUN_DIRECTIONS, sky], axis=-1).reshape(*shape, 2)
    return light


def _lattice(surface: PaintedSurface, steps: int, i: np.ndarray, j: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points and normals (m * s, 3) of the lattice entries i, j (s,) of all faces."""
    excess = np.maximum(i + j - steps, 0) / 2
    b, c = (i - excess) / steps, (j - excess) / steps
    weights = np.column_stack([1 - b - c, b, c])
    places = np.einsum("sk,mkx->msx", weights, surface.vertices[surface.faces])
    normals = np.einsum("sk,mkx->msx", weights, surface.normals)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    return places.reshape(-1, 3), normals.reshape(-1, 3)


def spread_over_cap(axis: np.ndarray, half_angle: float, count: int) -> np.ndarray:
    """(count, 3) unit vectors spread evenly over the cap of `half_angle` about `axis` (a Fibonacci spiral)."""
    k = np.arange(count) + 0.5
    z = 1 - k / count * (1 - np.cos(half_angle))
    turn = k * np.pi * (3 - np.sqrt(5))
    side, other = frame(axis)
    ring = np.sqrt(1 - z * z)
    return z[:, None] * axis + (ring * np.cos(turn))[:, None] * side + (ring * np.sin(turn))[:, None] * other


def frame(axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors perpendicular to the unit vector `axis` and to each other."""
    helper = np.eye(3)[np.argmin(np.abs(axis))]
    side = np.cross(axis, helper)
    side /= np.linalg.norm(side)
    return side, np.cross(axis, side)


def _is_lit(
    surface: PaintedSurface, places: np.ndarray, direction: np.ndarray, center: np.ndarray, radius: float
) -> np.ndarray:
    """(p,) float, 0 to 1: bilinear share of the four depth-map pixels around each point that do not shade it."""
    distance = 40 * radius
    side, other = frame(direction)
    R = np.array([side, -other, -direction])
    focal = 0.48 * MAP_SIZE * distance / radius
    K = np.array([[focal, 0, MAP_SIZE / 2], [0, focal, MAP_SIZE / 2], [0, 0, 1]])
    light = Camera.from_krt(K, R, -R @ (center + distance * direction), MAP_SIZE, MAP_SIZE)
    depth_map = rasterize(surface.vertices, surface.faces, light)[1]
    lit = np.ones(len(places))
    _compare(depth_map, light.image_from_world, places, 0.5 * LIFT * radius, lit)
    return lit


@njit(cache=True, nogil=True)
def _compare(depth_map: np.ndarray, P: np.ndarray, places: np.ndarray, margin: float, lit: np.ndarray) -> None:
    height, width = depth_map.shape
    for p in range(len(places)):
        X, Y, Z = places[p]
        depth = P[2, 0] * X + P[2, 1] * Y + P[2, 2] * Z + P[2, 3]
        u = (P[0, 0] * X + P[0, 1] * Y + P[0, 2] * Z + P[0, 3]) / depth
        v = (P[1, 0] * X + P[1, 1] * Y + P[1, 2] * Z + P[1, 3]) / depth
        x, y = int(np.floor(u)), int(np.floor(v))
        if x < 0 or y < 0 or x + 1 >= width or y + 1 >= height:
            continue
        fx, fy = u - x, v - y
        near = depth - margin
        lit[p] = (
            (1 - fx) * (1 - fy) * (depth_map[y, x] > near)
            + fx * (1 - fy) * (depth_map[y, x + 1] > near)
            + (1 - fx) * fy * (depth_map[y + 1, x] > near)
            + fx * fy * (depth_map[y + 1, x + 1] > near)
        )
