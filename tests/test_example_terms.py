"""The example terms of silhouettes and shading against bodies whose outline and normals are known without the code under test."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageDraw
from scipy.spatial import ConvexHull

import demo_scenes
from app.cli.main import run
from fairing import ArrayPhoto, Camera, InputError, OwnTerm, Scene, Trace, View, fair, load_scene
from fairing.run.own_files import load_own
from tests.small_scene import corner_scene, small_options

EXAMPLES = Path(demo_scenes.__file__).parent / "terms"
WIDTH, HEIGHT = 160, 120
BOX = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
BOX_FACES = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]
)  # fmt: skip
LIGHT = np.array([0.5, 0.3, 0.81])


def example(name: str) -> OwnTerm:
    (term,) = load_own([EXAMPLES / f"{name}.py"]).terms
    return term


def camera_at(direction: np.ndarray, target: np.ndarray, up: np.ndarray, distance: float, focal: float) -> Camera:
    forward = -direction
    right = np.cross(forward, up) / np.linalg.norm(np.cross(forward, up))
    R = np.stack([right, np.cross(forward, right), forward])
    K = np.array([[focal, 0, (WIDTH - 1) / 2], [0, focal, (HEIGHT - 1) / 2], [0, 0, 1]])
    return Camera.from_krt(K, R, -R @ (target + distance * direction), WIDTH, HEIGHT)


def outline(camera: Camera, corners: np.ndarray) -> np.ndarray:
    """(HEIGHT, WIDTH) bool: the image of a convex body."""
    pixels = camera.project(corners)[0]
    hull = pixels[ConvexHull(pixels).vertices]
    image = Image.new("L", (WIDTH * 8, HEIGHT * 8))
    ImageDraw.Draw(image).polygon([tuple(8 * (pixel + 0.5) - 0.5) for pixel in hull], fill=255)
    return np.asarray(image.resize((WIDTH, HEIGHT), Image.Resampling.BOX)) >= 128


def write_box(folder: Path) -> None:
    """A closed box, its corners displaced, with photos of noise alone: only the masks show where it is."""
    rng = np.random.default_rng(0)
    for name in ("images", "masks"):
        (folder / name).mkdir(parents=True)
    for i in range(12):
        z, turn = 1 - 2 * (i + 0.5) / 12, 2.4 * i
        direction = np.array([np.sqrt(1 - z * z) * np.cos(turn), np.sqrt(1 - z * z) * np.sin(turn), z])
        camera = camera_at(direction, np.full(3, 0.5), np.array([0, 0, 1.0]), 3.5, 180.0)
        Image.fromarray(rng.integers(110, 140, (HEIGHT, WIDTH, 3)).astype(np.uint8)).save(folder / f"images/{i}.png")
        Image.fromarray(outline(camera, BOX)).save(folder / f"masks/{i}.png")
        np.savetxt(folder / f"images/{i}.txt", camera.image_from_world, fmt="%.17g")
    start = BOX + 0.04 * rng.normal(size=BOX.shape)
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in start.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (BOX_FACES + 1).tolist()]
    (folder / "mesh.obj").write_text("\n".join(lines) + "\n")


def misplaced(scene: Scene, vertices: np.ndarray) -> tuple[float, float]:
    """Mean distance of the box's corners from the true ones, and the share of its images that is not that of the masks."""
    wrong, whole = 0, 0
    for view in scene.views:
        found, true = outline(view.camera, vertices), outline(view.camera, BOX)
        wrong, whole = wrong + (found != true).sum(), whole + true.sum()
    return float(np.linalg.norm(vertices - BOX, axis=1).mean()), float(wrong / whole)


@pytest.mark.compiled
def test_silhouettes_draw_a_displaced_box_into_its_masks(tmp_path: Path):
    write_box(tmp_path)
    scene = load_scene(tmp_path, points="none")
    before = misplaced(scene, scene.mesh.vertices)
    without = misplaced(scene, fair(scene, small_options()).vertices)
    after = misplaced(scene, fair(scene, small_options(), terms=[example("silhouettes")]).vertices)
    for start, alone, end in zip(before, without, after, strict=True):
        assert end < 0.4 * start < 0.4 * alone


def hull_corners(camera: Camera) -> int:
    return len(ConvexHull(camera.project(BOX)[0]).vertices)


def test_the_outline_is_the_hull_s_corners_without_hidden_contours_and_full_masks(tmp_path: Path):
    write_box(tmp_path)
    scene, term = load_scene(tmp_path, points="none"), example("silhouettes")
    hidden = np.vstack([BOX, 0.5 + 0.02 * (BOX[[0, 3, 5, 6]] - 0.5)])
    faces = np.vstack([BOX_FACES, 8 + np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])])
    found = term.begin(Scene.build("two", hidden, faces, scene.views), hidden)
    assert found.ids.max() < 8
    assert len(found.ids) == sum(hull_corners(view.camera) for view in scene.views)
    assert np.abs(found.residual(hidden)).max() < 1.0  # px: masks are black or white, and round off corners
    Image.new("L", (WIDTH, HEIGHT), 255).save(tmp_path / "masks/0.png")
    fewer = term.begin(load_scene(tmp_path, points="none"), BOX)
    assert len(fewer.ids) == len(found.ids) - hull_corners(scene.views[0].camera)


def test_silhouettes_without_masks_are_one_line():
    with pytest.raises(InputError, match=r"^term silhouettes: expected photos with masks, found none; see --masks$"):
        fair(corner_scene(), small_options(), terms=[example("silhouettes")])


@pytest.mark.slow
def test_silhouettes_pull_in_a_run_from_the_command_line(tmp_path: Path):
    write_box(tmp_path / "box")
    file = EXAMPLES / "silhouettes.py"
    flags = ["--points", "none", "--schedule.blur", "1.2", "--schedule.max-sweeps", "1"]
    assert run(["fair", str(tmp_path / "box"), "--out", str(tmp_path / "run"), "--with", str(file), *flags]) == 0
    (trace,) = (tmp_path / "run").glob("*.trace")
    (term,) = Trace.load(trace).header["own_terms"]
    assert (term["name"], term["file"]) == ("silhouettes", str(file))


def height(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return 0.12 * np.sin(3.1 * x + 0.4) * np.cos(2.7 * y - 0.3)


def normal(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(..., 3) float: unit normal of the sheet at height(x, y)."""
    slope_x = 0.12 * 3.1 * np.cos(3.1 * x + 0.4) * np.cos(2.7 * y - 0.3)
    slope_y = -0.12 * 2.7 * np.sin(3.1 * x + 0.4) * np.sin(2.7 * y - 0.3)
    result = np.stack([-slope_x, -slope_y, np.ones_like(x)], axis=-1)
    return result / np.linalg.norm(result, axis=-1, keepdims=True)


def photo(camera: Camera) -> ArrayPhoto:
    """The sheet under a light of 170 grey levels, and 40 from all sides."""
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    rays = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(camera.image_from_world[:, :3]).T
    x, y, z = np.moveaxis(camera.center - camera.center[2] * rays / rays[..., 2:], -1, 0)
    for _ in range(50):
        lift = 0.8 * (height(x, y) - z) / rays[..., 2]
        x, y, z = np.moveaxis(np.stack([x, y, z], axis=-1) + lift[..., None] * rays, -1, 0)
    grey = 40 + 170 * np.maximum(normal(x, y) @ LIGHT / np.linalg.norm(LIGHT), 0)
    return ArrayPhoto(np.repeat(np.rint(grey).astype(np.uint8)[..., None], 3, axis=2))


def bumpy_sheet() -> tuple[Scene, np.ndarray]:
    """A curved sheet of one albedo, its vertices displaced in height, and their true positions (n, 3)."""
    tilts = [(0.25, 0.45)[i % 2] for i in range(8)]
    directions = [
        np.array([np.sin(t) * np.cos(a), np.sin(t) * np.sin(a), np.cos(t)])
        for t, a in zip(tilts, 2 * np.pi * np.arange(8) / 8, strict=True)
    ]
    cameras = [camera_at(d, np.zeros(3), np.array([0, 1.0, 0]), 4.0, 230.0) for d in directions]
    views = tuple(View(f"photo{i}", camera, photo(camera)) for i, camera in enumerate(cameras))
    x, y = (k.ravel() for k in np.meshgrid(np.linspace(-0.7, 0.7, 11), np.linspace(-0.55, 0.55, 11)))
    truth = np.stack([x, y, height(x, y)], axis=-1)
    grid = np.arange(121).reshape(11, 11)
    a, b, c, d = (k.ravel() for k in (grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]))
    start = truth + np.random.default_rng(0).normal(size=121)[:, None] * [0, 0, 0.02]
    faces = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return Scene.build("sheet", start, faces, views, points_choice="none"), truth


def off_normal(scene: Scene, vertices: np.ndarray) -> float:
    """Mean angle of the faces' normals to those of the sheet in their middle, degrees."""
    corners = vertices[scene.mesh.faces]
    found = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    found /= np.linalg.norm(found, axis=1, keepdims=True)
    true = normal(*corners.mean(axis=1)[:, :2].T)
    return float(np.degrees(np.arccos(np.clip((found * true).sum(axis=1), -1, 1))).mean())


@pytest.mark.compiled
def test_shading_turns_normals_to_those_of_a_lit_sheet():
    scene, truth = bumpy_sheet()
    term = example("shading")
    start = scene.mesh.vertices
    assert np.abs(term.begin(scene, start).residual(start)).mean() > 6  # grey levels
    assert np.abs(term.begin(scene, truth).residual(truth)).mean() < 1.5
    before, alone = off_normal(scene, start), off_normal(scene, fair(scene, small_options()).vertices)
    with_term = off_normal(scene, fair(scene, small_options(), terms=[term]).vertices)
    assert with_term < 0.7 * alone < alone < before


def test_faces_of_another_albedo_do_not_change_the_light_of_the_others():
    scene, truth = bumpy_sheet()
    term = example("shading")
    plain = term.begin(scene, truth)
    painted = []
    for view in scene.views:
        pixels = view.photo.load().copy()
        u, v = np.rint(view.camera.project(np.array([[-0.3, -0.2, 0], [0.1, 0.15, 0]]))[0]).astype(int).T
        pixels[v.min() : v.max(), u.min() : u.max()] //= 2
        painted.append(View(view.name, view.camera, ArrayPhoto(pixels)))
    spotted = term.begin(Scene.build("spotted", truth, scene.mesh.faces, tuple(painted)), truth)
    change = spotted.residual(truth) - plain.residual(truth)
    far = np.abs(truth[scene.mesh.faces].mean(axis=1)[:, 0]) > 0.45
    assert np.abs(change).max() > 40  # grey levels
    assert np.abs(change[far]).max() < 1.5
