"""A corner of a cube in small photos: exact, quick to make, and written without the code under test.

Six triangles meet in vertex 0. Photos are ray cast through 4 x 4 points a pixel with numpy alone.
"""

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Literal

import numpy as np
from PIL import Image

from fairing.camera import Camera
from fairing.mesh import Mesh
from fairing.options import PRESETS, FairingOptions, options_from_dict, options_to_dict
from fairing.photo import ArrayPhoto
from fairing.scene import Scene, SparsePoints, Truth, View

WIDTH, HEIGHT, FOCAL = 160, 120, 230.0
VERTICES = np.array([[1, 1, 1], [0, 1, 1], [0, 0, 1], [1, 0, 1], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
FACES = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5], [0, 5, 6], [0, 6, 1]])
# The axes that stay along each face: the normals of the other two meet there.
NORMALS = [np.eye(3)[[a for a in range(3) if VERTICES[v, a] == 1]] for v in range(7)]
START = (0.06, -0.04, 0.05)


def small_options(preset: str = "accurate", **changes) -> FairingOptions:
    """A preset's last three levels, with blurs for faces of 50 px; nothing before Gauss-Newton.

    Args:
        changes: stage={option: value} or option=value.
    """
    values = options_to_dict(PRESETS[preset])
    values["levels"] = values["levels"][-3:]
    values["schedule"] |= {"blur": [2.0, 1.2, 0.6], "max_iterations": [4, 4, 3] if preset == "accurate" else [20]}
    values["step"] |= {"smoothing": [0.0], "points": [0.0], "creases": [0.0]}
    for name, value in changes.items():
        values[name] = values[name] | value if isinstance(value, dict) else value
    return options_from_dict(values)


@cache
def cameras(count: int = 8) -> tuple[Camera, ...]:
    """On two rings around the cube's diagonal, four edges from the corner."""
    result = []
    for i in range(count):
        turn, tilt = 2 * np.pi * i / count + 0.3, (0.18, 0.36)[i % 2]
        axis = np.ones(3) / np.sqrt(3)
        side = np.array([1, -1, 0]) / np.sqrt(2)
        up = np.cross(axis, side)
        direction = np.cos(tilt) * axis + np.sin(tilt) * (np.cos(turn) * side + np.sin(turn) * up)
        eye = np.ones(3) + (4 + 0.1 * i) * direction
        z = (np.full(3, 0.66) - eye) / np.linalg.norm(np.full(3, 0.66) - eye)
        x = np.cross(z, up) / np.linalg.norm(np.cross(z, up))
        R = np.stack([x, np.cross(z, x), z])
        K = np.array([[FOCAL, 0, 79.3], [0, FOCAL, 60.2], [0, 0, 1]])
        result.append(Camera.from_krt(K, R, -R @ eye, WIDTH, HEIGHT))
    return tuple(result)


def texture(side: int, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Grey level of a side at (u, v) in 0 to 1: waves of periods from 4 to 60 px and a few hard steps."""
    rng = np.random.default_rng(side)
    value = np.full(u.shape, 120.0)
    for _ in range(40):
        frequency = 2 * np.pi * np.exp(rng.uniform(np.log(0.8), np.log(12))) / 1.0
        angle, phase = rng.uniform(0, np.pi), rng.uniform(0, 2 * np.pi)
        value += 9 * np.sin(frequency * (np.cos(angle) * u + np.sin(angle) * v) + phase)
    return value + 14 * np.sign(np.sin(9 * u + 2 * v + side)) * np.sign(np.sin(7 * v - side))


@cache
def photos(count: int = 8) -> tuple[np.ndarray, ...]:
    """(HEIGHT, WIDTH, 3) uint8 each."""
    return tuple(_photo(camera) for camera in cameras(count))


def _photo(camera: Camera, oversampling: int = 4) -> np.ndarray:
    offsets = (np.arange(oversampling) + 0.5) / oversampling - 0.5
    y, x = np.meshgrid(
        (np.arange(HEIGHT)[:, None] + offsets).ravel(), (np.arange(WIDTH)[:, None] + offsets).ravel(), indexing="ij"
    )
    rays = np.stack([x, y, np.ones_like(x)], axis=-1) @ np.linalg.inv(camera.image_from_world[:, :3]).T
    value, nearest = np.full(x.shape, 30.0), np.full(x.shape, np.inf)
    for side in range(3):
        distance = (1 - camera.center[side]) / rays[..., side]
        point = camera.center + distance[..., None] * rays
        u, v = (point[..., a] for a in range(3) if a != side)
        hit = (distance > 0) & (distance < nearest) & (u >= 0) & (u <= 1) & (v >= 0) & (v <= 1)
        value[hit], nearest[hit] = texture(side, u[hit], v[hit]), distance[hit]
    grey = value.reshape(HEIGHT, oversampling, WIDTH, oversampling).mean(axis=(1, 3))
    return np.repeat(np.clip(np.round(grey), 0, 255).astype(np.uint8)[..., None], 3, axis=2)


def corner_scene(
    displacement: tuple[float, float, float] = START,
    count: int = 8,
    scale: float = 1.0,
    shift: tuple[float, float, float] = (0, 0, 0),
    order: list[int] | None = None,
    face_order: list[int] | None = None,
    change: dict[int, np.ndarray] | None = None,
) -> Scene:
    """The corner, vertex 0 off its place.

    Args:
        scale, shift: the world is scaled, then shifted; photos stay the same.
        order, face_order: permutations of the views and faces.
        change: photos that replace others, by view.
    """
    place = np.eye(4)
    place[:3, :3] /= scale
    place[:3, 3] = -np.asarray(shift) / scale
    views = [
        View(
            f"photo{i}",
            Camera(camera.image_from_world @ place, WIDTH, HEIGHT),
            ArrayPhoto((change or {}).get(i, photo)),
        )
        for i, (camera, photo) in enumerate(zip(cameras(count), photos(count), strict=True))
    ]
    start = VERTICES.copy()
    start[0] += displacement
    vertices, truth = (scale * v + np.asarray(shift) for v in (start, VERTICES))
    faces = FACES if face_order is None else FACES[face_order]
    return Scene.build(
        "corner", vertices, faces, tuple(views if order is None else [views[i] for i in order]),
        truth=Truth(Mesh(truth, FACES), truth, NORMALS), points_choice="given",
    )  # fmt: skip


def write_corner(folder: Path, displacement: tuple[float, float, float] = START) -> None:
    """The corner as files: photos, a matrix each, and mesh.obj with vertex 0 written twice."""
    (folder / "images").mkdir(parents=True)
    for i, (camera, photo) in enumerate(zip(cameras(), photos(), strict=True)):
        Image.fromarray(photo).save(folder / "images" / f"photo{i}.png")
        np.savetxt(folder / "images" / f"photo{i}.txt", camera.image_from_world, fmt="%.17g")
    start = VERTICES.copy()
    start[0] += displacement
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in np.vstack([start, start[:1]]).tolist()]
    faces = np.where((np.arange(6)[:, None] > 2) & (FACES == 0), 7, FACES)
    lines += [f"f {a} {b} {c}" for a, b, c in (faces + 1).tolist()]
    (folder / "mesh.obj").write_text("\n".join(lines) + "\n")


def sparse_points(positions: np.ndarray) -> SparsePoints:
    """Points (n, 3) that no photo is said to see."""
    nothing = np.zeros((0, 2))
    return SparsePoints(positions, np.zeros((len(positions), 3), np.uint8), nothing.astype(int), nothing)


def on_the_faces(count: int = 600, seed: int = 0) -> np.ndarray:
    """Points on the true faces, as many on each."""
    weights = np.random.default_rng(seed).dirichlet(np.ones(3), (count // len(FACES), len(FACES)))
    return np.einsum("cfk,fkx->cfx", weights, VERTICES[FACES]).reshape(-1, 3)


def observed(
    scene: Scene, positions: np.ndarray, origin: Literal["given", "own"] = "own", *, is_shared: bool = True
) -> Scene:
    """The scene with points (n, 3) that each photo observes without error.

    Args:
        is_shared: each both for the fit and held out; else every second one is held out, as in a run.
    """
    positions = np.repeat(positions, 2, axis=0) if is_shared else positions
    seen = [(p, v) for p in range(len(positions)) for v in range(len(scene.views))]
    pixels = np.array([scene.views[v].camera.project(positions[p])[0] for p, v in seen])
    points = SparsePoints(positions, np.zeros((len(positions), 3), np.uint8), np.array(seen), pixels, origin)
    return replace(scene, sparse_points=points)
