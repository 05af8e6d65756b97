"""Orbit pictures: meshes seen by the same camera, which goes around them."""

from collections.abc import Callable, Sequence

import numpy as np

from app.palette import BACKGROUND
from app.stage import MIN_MEAN, Stage
from fairing.camera import Camera
from fairing.errors import InputError
from fairing.geometry.normals import unit_normals
from fairing.scene import Scene
from fairing.texture import Drawing, textured_model

VIEWS = 19  # odd: the middle one looks in the direction in which the page of the debugger opens
ASIDE = np.radians(60.0)  # farthest turn where the cameras do not go around the mesh
DISTANCE = 3.0  # of the camera, in radii of the meshes
TEXELS = 2048
DARKEST, BRIGHTEST = 40.0, 235.0  # grey levels of faces seen edge-on and from the front


def orbit(scenes: Sequence[Scene], size: int) -> list[Camera]:
    """Cameras of `size` x `size` px around the meshes of scenes with the same photos, at one distance, each showing all of them."""
    stage = Stage.of(scenes[0])
    used = np.concatenate([scene.mesh.vertices[np.unique(scene.mesh.faces)] for scene in scenes])
    middle = (used.min(axis=0) + used.max(axis=0)) / 2
    radius = float(np.linalg.norm(used - middle, axis=1).max()) or 1.0
    begin, up = (vector / np.linalg.norm(vector) for vector in (stage.eye - stage.target, stage.up))
    directions = stage.camera_centers / np.linalg.norm(stage.camera_centers, axis=1, keepdims=True)
    goes_around = np.linalg.norm(directions.mean(axis=0)) < MIN_MEAN
    farthest = np.pi * (1 - 1 / VIEWS) if goes_around else ASIDE
    poses, reach = [], 0.0
    for angle in np.linspace(-farthest, farthest, VIEWS):
        cos, sin = np.cos(angle), np.sin(angle)
        direction = cos * begin + sin * np.cross(up, begin) + (1 - cos) * (up @ begin) * up
        eye = middle + DISTANCE * radius * direction
        right = np.cross(-direction, up)
        right /= np.linalg.norm(right)
        R = np.stack([right, np.cross(-direction, right), -direction])
        poses.append((R, eye))
        seen = (used - eye) @ R.T
        reach = max(reach, float(np.abs(seen[:, :2] / seen[:, 2:]).max()))
    focal = (size - 1) / 2 / reach
    K = np.array([[focal, 0, (size - 1) / 2], [0, focal, (size - 1) / 2], [0, 0, 1]])
    return [Camera.from_krt(K, R, -R @ eye, size, size) for R, eye in poses]


def orbit_pictures(
    scene: Scene, cameras: Sequence[Camera], on_progress: Callable[[float], None]
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Pictures (h, w, 3) uint8, RGB, of a scene's mesh in each camera: with the texture of its photos, and shaded.

    Args:
        on_progress: called with the fraction that is done.

    Raises:
        InputError: the mesh has too many faces for the texture, or a photo is missing.
    """
    mesh = scene.mesh
    try:
        model = textured_model(scene, mesh.vertices, TEXELS, lambda fraction: on_progress(0.7 * fraction))
    except ValueError as error:
        raise InputError(f"{error}; the mesh is too large for a picture with its texture") from None
    textured, shaded = [], []
    for number, camera in enumerate(cameras):
        drawing = Drawing(mesh.vertices, mesh.faces, camera)
        textured.append(drawing.textured(model.uv, model.image, BACKGROUND))
        shaded.append(drawing.textured(*_shading(scene, camera), BACKGROUND))
        on_progress(0.7 + 0.3 * (number + 1) / len(cameras))
    return textured, shaded


def _shading(scene: Scene, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Texture coordinates (m, 3, 2) and a texture with one texel a face, grey by the angle to the line of sight."""
    mesh = scene.mesh
    sight = mesh.vertices[mesh.faces].mean(axis=1) - camera.center
    normals, _ = unit_normals(mesh.vertices, mesh.faces)
    cosine = np.abs((normals * sight).sum(axis=1)) / np.linalg.norm(sight, axis=1)
    grey = DARKEST + (BRIGHTEST - DARKEST) * cosine
    side = int(np.ceil(np.sqrt(len(grey)))) + 1  # the last row and column of a texture are not reached exactly
    row, column = np.divmod(np.arange(len(grey)), side - 1)
    image = np.zeros((side, side, 3), dtype=np.uint8)
    image[row, column] = np.round(grey)[:, None]
    uv = np.stack([column + 0.5, row + 0.5], axis=1) / side
    return np.repeat(uv[:, None], 3, axis=1), image
