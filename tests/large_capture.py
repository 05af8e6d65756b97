"""Captures of any size: a hilly terrain, photographed in strips from the air, as our own `scene.json`.

The photos show the very triangles of the mesh in their true places; the mesh written beside them is off by some pixels.
"""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cv2
import numpy as np

from fairing.camera import Camera
from fairing.geometry.rasterize import rasterize
from fairing.io import scene_json, write_mesh
from fairing.photo import FilePhoto
from fairing.scene import View

SEEN_BY = 16  # photos that see a place, about
HEIGHT = 0.08  # of the hills; the terrain is 1 x 1
OFF = 1.0  # px that the start's vertices lie off, about
TILE = 2048  # texels of the texture, which repeats


def write_terrain(folder: Path, n_vertices: int, n_photos: int, photo_size: tuple[int, int]) -> None:
    """A capture of about so many vertices and exactly so many photos (JPEG) of a size (width, height)."""
    (folder / "images").mkdir(parents=True)
    side = round(n_vertices**0.5)
    true, faces = _terrain(side)
    cameras = _cameras(n_photos, photo_size)
    texture = _texture()
    pixels_per_unit = float(np.linalg.norm(cameras[0].J_image_wrt_point(np.array([0.5, 0.5, 0.0])), 2))

    def take(v: int) -> View:
        path = folder / "images" / f"{v:03}.jpg"
        cv2.imwrite(
            str(path), _photo(true, faces, cameras[v], texture, pixels_per_unit), [cv2.IMWRITE_JPEG_QUALITY, 92]
        )
        return View(path.name, cameras[v], FilePhoto(path))

    with ThreadPoolExecutor(2) as pool:
        views = list(pool.map(take, range(n_photos)))
    start = true + np.random.default_rng(0).normal(size=true.shape) * OFF / pixels_per_unit * [0.2, 0.2, 1]
    write_mesh(folder / "mesh.ply", start, faces)
    scene_json.write(folder, views, None, "mesh.ply")


def _terrain(side: int) -> tuple[np.ndarray, np.ndarray]:
    x, y = (w.ravel() for w in np.meshgrid(*2 * [np.linspace(0, 1, side)]))
    hills = np.sin(9 * x + 1) * np.sin(7 * y) + 0.5 * np.sin(23 * x - 11 * y) + 0.25 * np.sin(41 * y + 17 * x)
    a = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    faces = np.concatenate([np.stack([a, a + 1, a + side + 1], 1), np.stack([a, a + side + 1, a + side], 1)])
    return np.column_stack([x, y, HEIGHT * hills / 2]), faces


def _cameras(count: int, size: tuple[int, int]) -> list[Camera]:
    """In rows over the terrain, each looking 20 degrees aslant."""
    rows = max(2, round(count**0.5))
    extent = min(1.0, (SEEN_BY / count) ** 0.5)  # what one photo sees of the terrain's side
    distance = 1.2 * extent
    focal = distance * size[0] / extent
    cameras = []
    for i in range(count):
        row, column = divmod(i, rows)
        place = (np.array([column, row]) + 0.5) / (rows, -(-count // rows))
        middle = np.append(extent / 2 + (1 - extent) * place, 0.0)
        turn = 2.4 * i  # the golden angle: no two alike
        tilt = np.radians(20.0)
        away = np.array([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)])
        eye = middle + distance * away
        x = np.cross([0, 1.0, 0], -away)
        x /= np.linalg.norm(x)
        R = np.stack([x, np.cross(-away, x), -away])
        K = np.array([[focal, 0, (size[0] - 1) / 2], [0, focal, (size[1] - 1) / 2], [0, 0, 1]])
        cameras.append(Camera.from_krt(K, R, -R @ eye, *size))
    return cameras


def _texture() -> np.ndarray:
    """(TILE, TILE, 3) uint8: noise at every scale."""
    rng = np.random.default_rng(1)
    total = np.zeros((TILE, TILE, 3), np.float32)
    for octave in range(9):
        size = TILE >> octave
        noise = rng.normal(size=(size, size, 3)).astype(np.float32)
        total += (1.3**octave) * cv2.resize(noise, (TILE, TILE), interpolation=cv2.INTER_CUBIC)
    return np.clip(128 + 45 * total / total.std(), 0, 255).astype(np.uint8)


def _photo(
    vertices: np.ndarray, faces: np.ndarray, camera: Camera, texture: np.ndarray, texels_per_unit: float
) -> np.ndarray:
    """The terrain, (h, w, 3) uint8, grey where there is none; the texture is the same in all photos."""
    face_id, depth = rasterize(vertices, faces, camera)
    M, t = camera.image_from_world[:, :3], camera.image_from_world[:, 3]
    image = np.full((camera.height, camera.width, 3), 90, np.uint8)
    inverse = np.linalg.inv(M).astype(np.float32)
    column = np.arange(camera.width, dtype=np.float32)
    for rows in np.array_split(np.arange(camera.height), max(1, camera.height // 256)):
        known = face_id[rows] >= 0
        z = np.where(known, depth[rows], 1).astype(np.float32)
        rays = np.stack([np.broadcast_to(column, z.shape), np.broadcast_to(rows[:, None], z.shape), np.ones_like(z)])
        pixel = (z * rays - t[:, None, None]).astype(np.float32)
        x, y = (texels_per_unit * np.tensordot(inverse[axis], pixel, 1) % TILE for axis in (0, 1))
        found = cv2.remap(texture, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
        image[rows] = np.where(known[..., None], found, image[rows])
    return image
