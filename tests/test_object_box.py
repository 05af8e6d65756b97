"""The object of a capture: the box around what most photos look at, without ground and background."""

import json
import re
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.cli.main import run
from app.files.scene_source import SceneSource
from fairing.camera import Camera
from fairing.errors import InputError
from fairing.features import find_points
from fairing.geometry.up_direction import up_direction
from fairing.io import load_scene
from fairing.io.convert import write_capture
from fairing.photo import ArrayPhoto
from fairing.scene import Around, SparsePoints, View
from fairing.structure.frame import upright_frame
from fairing.triangulation.object_box import find_object
from fairing.triangulation.points_in_box import box_words, points_around
from tests.camera_orbit import looking_at
from tests.small_scene import write_corner
from tests.speckled_corner import views as corner_views

WIDTH, HEIGHT, FOCAL = 160, 120, 150.0
SIZE = np.array([2.0, 1.2, 1.5])
"""Sides of the object, which stands on the ground z = 0."""


def photos_of(eyes: np.ndarray, targets: np.ndarray) -> tuple[View, ...]:
    blank = ArrayPhoto(np.zeros((HEIGHT, WIDTH, 3), np.uint8))
    K = np.array([[FOCAL, 0, WIDTH / 2], [0, FOCAL, HEIGHT / 2], [0, 0, 1]])
    poses = [looking_at(eye, target) for eye, target in zip(eyes, targets, strict=True)]
    cameras = [Camera.from_krt(K, R, -R @ eye, WIDTH, HEIGHT) for R, eye in zip(poses, eyes, strict=True)]
    return tuple(View(f"{i}.png", camera, blank) for i, camera in enumerate(cameras))


def orbit(arc: float, n: int = 20) -> np.ndarray:
    """Centres of cameras on a part of a circle around the object, at eye height."""
    angle = np.radians(np.linspace(0, arc, n, endpoint=arc < 360))
    return np.column_stack([6 * np.cos(angle), 6 * np.sin(angle), np.full(n, 2.0)])


def seen(views: tuple[View, ...], positions: np.ndarray) -> SparsePoints:
    """The points with all their observations."""
    observations, pixels = [], []
    for v, view in enumerate(views):
        uv, depth = view.camera.project(positions)
        inside = np.flatnonzero((depth > 0) & ((uv > 0) & (uv < (WIDTH - 1, HEIGHT - 1))).all(axis=1))
        observations.append(np.column_stack([inside, np.full(len(inside), v)]))
        pixels.append(uv[inside])
    colors = np.zeros((len(positions), 3), np.uint8)
    return SparsePoints(positions, colors, np.concatenate(observations), np.concatenate(pixels))


def object_and_surroundings() -> tuple[np.ndarray, np.ndarray]:
    """Points of an object, of the ground around it and of a background; and which are the object's."""
    rng = np.random.default_rng(4)
    body = rng.uniform(-0.5, 0.5, (1500, 3))
    body[np.arange(1500), rng.integers(0, 3, 1500)] = rng.choice([-0.5, 0.5], 1500)  # on the sides of a cube
    body = (body + np.array([0, 0, 0.5])) * SIZE
    body = body[body[:, 2] > 0.02]
    ground = np.column_stack([rng.uniform(-5, 5, (2000, 2)), rng.normal(0, 0.004, 2000)])
    around = rng.uniform(0, 2 * np.pi, 800)
    far = np.column_stack([25 * np.cos(around), 25 * np.sin(around), rng.uniform(0, 9, 800)])
    return np.concatenate([body, ground, far]), np.arange(len(body))


@pytest.mark.parametrize("arc", [360, 220])
def test_the_box_holds_the_object_and_neither_ground_nor_background(arc: int):
    positions, of_object = object_and_surroundings()
    eyes = orbit(arc)
    views = photos_of(eyes, np.tile([0, 0, 0.6], (len(eyes), 1)))
    box = find_object(views, seen(views, positions))
    assert box is not None
    assert box.orbited, box.reason
    inside = box.contains(positions)
    assert inside[of_object].mean() > 0.93
    assert inside.sum() - inside[of_object].sum() < 0.03 * len(of_object)
    np.testing.assert_allclose(np.sort(box.size[:2]), np.sort(SIZE[:2]), rtol=0.15)
    np.testing.assert_allclose(box.axes[2], [0, 0, 1], atol=0.01)
    edges = box.edges()
    assert edges.shape == (12, 2, 3)
    lengths = np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1)
    np.testing.assert_allclose(np.sort(lengths), np.sort(np.repeat(box.size, 4)))
    assert box.contains(box.middle + 0.999 * (edges.reshape(-1, 3) - box.middle)).all()


def test_the_frame_of_a_capture_is_upright_with_the_object_in_the_middle():
    positions, of_object = object_and_surroundings()
    rotation = Rotation.from_rotvec([0.8, -1.1, 0.5]).as_matrix()
    eyes = orbit(360)
    moved_eyes, moved_targets = 7 * eyes @ rotation.T + 3, 7 * np.tile([0, 0, 0.6], (20, 1)) @ rotation.T + 3
    blank = ArrayPhoto(np.zeros((HEIGHT, WIDTH, 3), np.uint8))
    K = np.array([[FOCAL, 0, WIDTH / 2], [0, FOCAL, HEIGHT / 2], [0, 0, 1]])
    views = []
    for i, (eye, target) in enumerate(zip(moved_eyes, moved_targets, strict=True)):
        R = looking_at(eye, target, rotation @ [0, 0, 1])
        views.append(View(f"{i}.png", Camera.from_krt(K, R, -R @ eye, WIDTH, HEIGHT), blank))
    points = seen(tuple(views), 7 * positions @ rotation.T + 3)
    frame = upright_frame(views, points)
    cameras = [frame.camera(view.camera) for view in views]
    np.testing.assert_allclose(
        up_direction(np.array([c.camera_from_world[:, :3] for c in cameras])), [0, 0, 1], atol=0.02
    )
    body = frame.mesh_from_world(points.positions)[of_object]
    np.testing.assert_allclose((body.min(axis=0) + body.max(axis=0)) / 2, 0, atol=0.02)
    distance = np.concatenate(
        [np.linalg.norm(frame.mesh_from_world(points.positions[points.observations[points.observations[:, 1] == v, 0]])
                        - camera.center, axis=1) for v, camera in enumerate(cameras)]
    )  # fmt: skip
    assert np.median(distance) == pytest.approx(1)


def test_photos_from_one_side_take_everything():
    positions, _ = object_and_surroundings()
    views = photos_of(orbit(70), np.tile([0, 0, 0.6], (20, 1)))
    points = seen(views, positions)
    taken, box, note = points_around(views, points, "automatic")
    assert taken is points
    assert (box, note) == (None, "")
    chosen, box, note = points_around(views, points, "object")
    assert box is not None
    assert len(chosen.positions) == box.n_points < len(positions)
    assert "because the cameras look from one side" in note
    uv, _ = views[3].camera.project(chosen.positions[chosen.observations[chosen.observations[:, 1] == 3, 0]])
    np.testing.assert_allclose(uv, chosen.pixels[chosen.observations[:, 1] == 3], atol=1e-9)


def test_photos_from_the_middle_of_a_courtyard_have_no_object():
    rng = np.random.default_rng(2)
    around = rng.uniform(0, 2 * np.pi, 3000)
    walls = np.column_stack([12 * np.cos(around), 12 * np.sin(around), rng.uniform(0, 4, 3000)])
    eyes = orbit(360) / 2
    views = photos_of(eyes, np.column_stack([-eyes[:, :2], np.full(20, 2.0)]))
    points = seen(views, walls)
    assert points_around(views, points, "automatic")[0] is points
    with pytest.raises(InputError, match="--around object: no points were found that most photos look at"):
        points_around(views, points, "object")


def test_a_run_records_which_points_were_triangulated(tmp_path: Path):
    header: dict = {}
    for around in get_args(Around):
        SceneSource(str(tmp_path), around=around).note_in(header)
        assert SceneSource.of_run(header, tmp_path / "run.trace").around == around
    header["source"]["around"] = "nothing"
    with pytest.raises(InputError, match="around: expected one of automatic, object, everything, found nothing"):
        SceneSource.of_run(header, tmp_path / "run.trace")


CORNERS = (-0.5, -1.0, 0.2, 1.5, 1.0, 2.0)
WORDS = "--box -0.5000 -1.0000 0.2000 1.5000 1.0000 2.0000"


def test_the_points_in_a_chosen_box_are_triangulated():
    positions, _ = object_and_surroundings()
    views = photos_of(orbit(70), np.tile([0, 0, 0.6], (20, 1)))
    points = seen(views, positions)
    taken, box, note = points_around(views, points, "automatic", CORNERS)
    inside = ((positions >= CORNERS[:3]) & (positions <= CORNERS[3:])).all(axis=1)
    assert box is not None
    assert 0 < inside.sum() < len(positions)
    np.testing.assert_array_equal(taken.positions, positions[inside])
    np.testing.assert_array_equal(box.bounds, (CORNERS[:3], CORNERS[3:]))
    assert note == f"{WORDS}: {inside.sum()} of {len(positions)} sparse points; the mesh covers them alone"
    with pytest.raises(InputError, match=r"expected at least 3 sparse points in the box, found 0 of .* are in --box -"):
        points_around(views, points, "automatic", (90, 90, 90, 91, 91, 91))


def test_the_box_that_was_found_can_be_chosen_again_and_changed():
    positions, _ = object_and_surroundings()
    eyes = orbit(360)
    views = photos_of(eyes, np.tile([0, 0, 0.6], (len(eyes), 1)))
    points = seen(views, positions)
    found, box, note = points_around(views, points, "automatic")
    assert box is not None
    words = re.search("change (--box [-0-9. ]+)", note)
    assert words is not None
    low, high = box.bounds
    corners = [float(word) for word in words[1].split()[1:]]
    np.testing.assert_allclose(corners, [*low, *high], atol=1e-3)
    chosen, _, _ = points_around(views, points, "automatic", tuple(corners))  # pyright: ignore[reportArgumentType]
    assert len(found.positions) <= len(chosen.positions) < 1.2 * len(found.positions)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_the_words_of_a_box_give_it_again_to_a_ten_thousandth(scale: float):
    corners = scale * (np.array(CORNERS) + 7000)
    words = box_words(corners.tolist())
    assert "e" not in words
    again = np.array([float(word) for word in words.split()[1:]])
    assert np.abs(again - corners).max() <= 1e-4 * 2 * scale


@pytest.mark.parametrize(
    ("flags", "line"),
    [
        (["--box", *["0", "0", "0", "1", "1", "-1"]], "expected x0 y0 z0 x1 y1 z1 with z0 < z1, found 0 and -1"),
        (["--box", *["0", "0", "0", "nan", "1", "1"]], "expected x0 y0 z0 x1 y1 z1 with x0 < x1, found 0 and nan"),
        (["--box", *["0", "0", "0", "1", "inf", "1"]], "with y0 < y1, found 0 and inf"),
        (
            ["--box", *["0", "0", "0", "1", "1", "1"], "--around", "object"],
            "as --around object does; leave one of them out",
        ),
        (["--box", *["0", "0", "0", "1", "1", "1"]], "expected a capture without a mesh, found "),
    ],
    ids=["inverted", "nan", "infinite", "around", "mesh"],
)
def test_a_box_that_cannot_be_used_is_one_line(tmp_path: Path, capsys, flags: list[str], line: str):
    write_corner(tmp_path / "corner")
    assert run(["check", str(tmp_path / "corner"), *flags]) == 1
    said = capsys.readouterr().err
    assert line in said
    assert said.count("\n") == 1
    assert said.startswith("eigenfairing: --box")


def test_a_mesh_whose_edges_are_flipped_takes_no_box(tmp_path: Path, capsys):
    write_corner(tmp_path / "corner")
    mesh = ["--mesh", str(tmp_path / "corner" / "mesh.obj"), "--out", str(tmp_path / "start.ply")]
    assert run(["triangulate", str(tmp_path / "corner"), *mesh, "--box", *["0", "0", "0", "1", "1", "1"]]) == 1
    assert "--box: expected no mesh, found --mesh" in capsys.readouterr().err


def test_a_run_in_a_chosen_box_records_it_and_is_opened_again(tmp_path: Path):
    capture = tmp_path / "corner"
    write_capture(capture, "scene.json", corner_views(), find_points(corner_views()).sparse_points())
    source = SceneSource.typed(str(capture), None, points="given", box=(-1, -1, -1, 2, 2, 0.8))
    scene, header = source.load(), {}
    assert scene.object_box is not None
    assert scene.mesh.vertices[:, 2].max() <= 0.8
    source.note_in(header)
    again = SceneSource.of_run(json.loads(json.dumps(header)), tmp_path / "run.trace")
    assert again.box == source.box
    np.testing.assert_array_equal(again.load().mesh.vertices, scene.mesh.vertices)
    from_python = load_scene(capture, points="given", cameras="given", box=source.box)
    np.testing.assert_array_equal(from_python.mesh.vertices, scene.mesh.vertices)
    header["source"]["box"] = [1, 2]
    with pytest.raises(InputError, match=r"source.box: expected 6 numbers, found \[1, 2\]"):
        SceneSource.of_run(header, tmp_path / "run.trace")


def test_with_a_mesh_there_is_nothing_to_triangulate(tmp_path: Path):
    write_corner(tmp_path)
    with pytest.raises(InputError, match=r"--around object: expected a capture without a mesh, found .*mesh\.obj"):
        load_scene(tmp_path, around="object")
