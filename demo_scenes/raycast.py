"""Ray casting of a stage: rays through a grid of points in every pixel, intersected exactly with the faces' planes."""

from functools import reduce
from math import floor
from typing import NamedTuple

import numpy as np
from numba import njit

from demo_scenes.surface import PaintedSurface, Stage
from fairing.camera import Camera
from fairing.geometry.rasterize import rasterize
from fairing.util.compiled_only import COMPILED_ONLY

STRIP_ROWS = 48  # photo rows rendered at a time, to bound memory
SHININESS = 10.0  # exponent of a broad specular lobe


def photograph(stage: Stage, light: np.ndarray, camera: Camera, samples: int) -> np.ndarray:
    """The photo of a noiseless sensor without lens: (height, width, 3) float64, grey levels, not clipped.

    A pixel is the mean over its square of `samples` x `samples` rays. A ray through image point u meets the plane of
    a face with corners X_k at barycentric weights lambda ~ inv([P X_0, P X_1, P X_2]) u, scaled to the sum 1: exact
    perspective.

    Args:
        light: from `light_lattice(stage)`.
    """
    surface = stage.surface
    P = camera.image_from_world
    corners = surface.vertices[surface.faces] @ P[:, :3].T + P[:, 3]  # (m, 3 corners, 3 homogeneous pixels)
    # Faces that reach behind the camera or whose plane holds its centre are not seen.
    volume = np.abs(np.linalg.det(corners)) / np.linalg.norm(corners, axis=2).prod(axis=1)
    in_front = (corners[..., 2] > 0).all(axis=1) & (volume > 1e-12)
    weights_from_image = np.zeros((len(corners), 3, 3))
    weights_from_image[in_front] = np.linalg.inv(corners[in_front].transpose(0, 2, 1))
    paint = _paint(surface)
    lighting = _Lighting(light, stage.sun_direction, stage.sun_color, stage.sky_color, stage.gloss)
    photo = np.zeros((camera.height, camera.width, 3))
    for first_row in range(0, camera.height, STRIP_ROWS):
        rows = min(STRIP_ROWS, camera.height - first_row)
        finer = Camera(_finer(samples, first_row) @ P, camera.width * samples, rows * samples)
        face_id = rasterize(surface.vertices, surface.faces, finer)[0]
        _shade(
            photo[first_row : first_row + rows],
            face_id,
            first_row,
            samples,
            weights_from_image,
            paint,
            lighting,
            stage.background,
            _background_share(stage, camera, face_id < 0, first_row, samples),
            camera.center,
        )
    return photo


def _finer(samples: int, first_row: int) -> np.ndarray:
    """(3, 3): pixels of the ray grid from photo pixels, the strip's first row on top."""
    shift = (samples - 1) / 2
    return np.array([[samples, 0, shift], [0, samples, shift - samples * first_row], [0, 0, 1.0]])


class _Paint(NamedTuple):
    """A surface of m faces for the compiled loops; all textures lie in one array.

    Attributes:
        corners, normals: (m, 3, 3) float: positions, world units, and unit normals of the faces' corners.
        texture_of_face: (m,) int.
        texel: (m, 3, 2) float, texels: the faces' corners in their texture.
        texels: flat uint8: the textures (h, w, 3), one after another.
        shapes: (t, 2) int: height and width of each texture.
        starts: (t,) int: where each texture starts in `texels`.
    """

    corners: np.ndarray
    normals: np.ndarray
    texture_of_face: np.ndarray
    texel: np.ndarray
    texels: np.ndarray
    shapes: np.ndarray
    starts: np.ndarray


class _Lighting(NamedTuple):
    """The light of a stage for the compiled loops: see `Stage`; `lattice` from `light_lattice`."""

    lattice: np.ndarray
    sun_direction: np.ndarray
    sun_color: np.ndarray
    sky_color: np.ndarray
    gloss: float


def _paint(surface: PaintedSurface) -> _Paint:
    textures = surface.textures
    sizes = np.array([texture.size for texture in textures], dtype=np.int64)
    shapes = np.array([texture.shape[:2] for texture in textures], dtype=np.int64)
    texels = np.concatenate([texture.ravel() for texture in textures])
    corners = surface.vertices[surface.faces]
    return _Paint(
        corners, surface.normals, surface.texture_of_face, surface.texel, texels, shapes, np.cumsum(sizes) - sizes
    )


def _background_share(
    stage: Stage, camera: Camera, is_background: np.ndarray, first_row: int, samples: int
) -> np.ndarray:
    """(rows, width) float, of a strip's pixels with a ray that meets no face: 0 at the horizon, 1 straight up, else between.

    Args:
        is_background: (rows * samples, width * samples) bool: rays that meet no face.
    """
    every = range(samples)
    is_seen = reduce(np.logical_or, [is_background[y::samples, x::samples] for y in every for x in every])
    row, column = np.divmod(np.flatnonzero(is_seen), camera.width)
    pixels = np.column_stack([column, first_row + row, np.ones(len(row))])
    rays = pixels @ np.linalg.inv(camera.image_from_world[:, :3]).T
    x, y, z = rays.T
    elevation = rays @ stage.up / np.sqrt(x * x + y * y + z * z)
    share = np.zeros(is_seen.shape)
    share[is_seen] = np.clip(elevation, 0, 1) ** 0.7
    return share


@njit(cache=True, nogil=True)
def _shade(
    photo, face_id, first_row, samples, weights_from_image, paint, lighting, background, background_share, eye
):  # fmt: skip
    """The mean colour of the rays through each pixel of a strip.

    Args:
        photo: (rows, width, 3) float64, out: the strip.
        face_id: (rows * samples, width * samples) int: the face that each ray meets, -1 for none.
        first_row: of the strip in the photo.
        samples: rays per pixel along an axis.
        weights_from_image: (m, 3, 3) float: times (u, v, 1) proportional to the barycentric weights of a face.
        paint, lighting: `_Paint` and `_Lighting`.
        background: (2, 3) float: see `Stage`.
        background_share: (rows, width) float: from `_background_share`.
        eye: (3,) float, world units.
    """
    # Unpacked here, because a field of a tuple is reference-counted at every access: half the speed within the loop.
    corners, normals, texture_of_face, texel, texels, shapes, starts = paint
    lattice, sun_direction, sun_color, sky_color, gloss = lighting
    share = 1.0 / (samples * samples)
    for y in range(photo.shape[0]):
        for x in range(photo.shape[1]):
            red = green = blue = 0.0
            up = background_share[y, x]
            for sy in range(samples):
                v = first_row + y + (sy + 0.5) / samples - 0.5
                for sx in range(samples):
                    f = face_id[y * samples + sy, x * samples + sx]
                    if f < 0:
                        red += background[0, 0] + up * (background[1, 0] - background[0, 0])
                        green += background[0, 1] + up * (background[1, 1] - background[0, 1])
                        blue += background[0, 2] + up * (background[1, 2] - background[0, 2])
                        continue
                    u = x + (sx + 0.5) / samples - 0.5
                    a, b, c = _barycentric(weights_from_image, f, u, v)
                    t = texture_of_face[f]
                    tx = a * texel[f, 0, 0] + b * texel[f, 1, 0] + c * texel[f, 2, 0]
                    ty = a * texel[f, 0, 1] + b * texel[f, 1, 1] + c * texel[f, 2, 1]
                    albedo = _look_up(texels, starts[t], shapes[t, 0], shapes[t, 1], tx, ty)
                    nx, ny, nz = _unit_normal(normals, f, a, b, c)
                    cosine = max(nx * sun_direction[0] + ny * sun_direction[1] + nz * sun_direction[2], 0.0)
                    sunlit, sky = _interpolate(lattice, f, b, c)
                    sun = cosine * sunlit
                    glint = 0.0
                    if gloss > 0 and sun > 0:
                        glint = gloss * sun * _specular(corners, f, a, b, c, eye, sun_direction, nx, ny, nz)
                    red += albedo[0] * (sun * sun_color[0] + sky * sky_color[0]) + glint
                    green += albedo[1] * (sun * sun_color[1] + sky * sky_color[1]) + glint
                    blue += albedo[2] * (sun * sun_color[2] + sky * sky_color[2]) + glint
            photo[y, x, 0] = red * share
            photo[y, x, 1] = green * share
            photo[y, x, 2] = blue * share


@njit(nogil=True, **COMPILED_ONLY)
def _barycentric(weights_from_image, f, u, v):
    """Barycentric weights on face f at image point (u, v); rays on an edge may miss it by rounding, so they are clamped."""
    a = weights_from_image[f, 0, 0] * u + weights_from_image[f, 0, 1] * v + weights_from_image[f, 0, 2]
    b = weights_from_image[f, 1, 0] * u + weights_from_image[f, 1, 1] * v + weights_from_image[f, 1, 2]
    c = weights_from_image[f, 2, 0] * u + weights_from_image[f, 2, 1] * v + weights_from_image[f, 2, 2]
    total = a + b + c
    a, b, c = max(a / total, 0.0), max(b / total, 0.0), max(c / total, 0.0)
    total = a + b + c
    return a / total, b / total, c / total


@njit(nogil=True, **COMPILED_ONLY)
def _unit_normal(normals, f, a, b, c):
    """Unit normal of face f at barycentric weights."""
    nx = a * normals[f, 0, 0] + b * normals[f, 1, 0] + c * normals[f, 2, 0]
    ny = a * normals[f, 0, 1] + b * normals[f, 1, 1] + c * normals[f, 2, 1]
    nz = a * normals[f, 0, 2] + b * normals[f, 1, 2] + c * normals[f, 2, 2]
    n = (nx * nx + ny * ny + nz * nz) ** 0.5
    return nx / n, ny / n, nz / n


@njit(nogil=True, **COMPILED_ONLY)
def _specular(corners, f, a, b, c, eye, sun_direction, nx, ny, nz):
    """Specular lobe of Blinn and Phong, 0 to 1, by the half vector between the eye and the sun."""
    hx = eye[0] - a * corners[f, 0, 0] - b * corners[f, 1, 0] - c * corners[f, 2, 0]
    hy = eye[1] - a * corners[f, 0, 1] - b * corners[f, 1, 1] - c * corners[f, 2, 1]
    hz = eye[2] - a * corners[f, 0, 2] - b * corners[f, 1, 2] - c * corners[f, 2, 2]
    h = (hx * hx + hy * hy + hz * hz) ** 0.5
    hx, hy, hz = hx / h + sun_direction[0], hy / h + sun_direction[1], hz / h + sun_direction[2]
    h = (hx * hx + hy * hy + hz * hz) ** 0.5
    return max((nx * hx + ny * hy + nz * hz) / h, 0.0) ** SHININESS


@njit(nogil=True, **COMPILED_ONLY)
def _look_up(texels, start, height, width, tx, ty):
    """Bilinear colour at texel (tx, ty) of a texture that repeats."""
    x, y = floor(tx), floor(ty)
    fx, fy = tx - x, ty - y
    x0, y0 = x % width, y % height
    x1, y1 = x0 + 1 if x0 + 1 < width else 0, y0 + 1 if y0 + 1 < height else 0
    above, below = start + 3 * y0 * width, start + 3 * y1 * width
    left, right = 3 * x0, 3 * x1
    return (
        _bilinear(texels, above + left, above + right, below + left, below + right, fx, fy),
        _bilinear(texels, above + left + 1, above + right + 1, below + left + 1, below + right + 1, fx, fy),
        _bilinear(texels, above + left + 2, above + right + 2, below + left + 2, below + right + 2, fx, fy),
    )


@njit(nogil=True, **COMPILED_ONLY)
def _bilinear(texels, i00, i01, i10, i11, fx, fy):
    """Between four values of `texels`."""
    above = texels[i00] * (1 - fx) + texels[i01] * fx
    below = texels[i10] * (1 - fx) + texels[i11] * fx
    return above * (1 - fy) + below * fy


@njit(nogil=True, **COMPILED_ONLY)
def _interpolate(light, f, b, c):
    """Sunlight and skylight of a face at barycentric weights b, c: linear over the triangles of its lattice."""
    steps = light.shape[1] - 1
    i, j = min(int(b * steps), steps - 1), min(int(c * steps), steps - 1)
    p, q = b * steps - i, c * steps - j
    k, n = i, j  # the triangle's corner at the right angle
    if p + q > 1:
        k, n, p, q = i + 1, j + 1, 1 - q, 1 - p
    sun, sky = light[f, k, n, 0], light[f, k, n, 1]
    return (
        sun + p * (light[f, i + 1, j, 0] - sun) + q * (light[f, i, j + 1, 0] - sun),
        sky + p * (light[f, i + 1, j, 1] - sky) + q * (light[f, i, j + 1, 1] - sky),
    )
