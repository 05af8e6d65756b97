"""Scene: welding, what it refuses, the check that photos show the mesh, and photos loaded lazily."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from fairing.camera import Camera
from fairing.errors import InputError
from fairing.io.in_view import check_mesh_in_view
from fairing.photo import ArrayPhoto, FilePhoto
from fairing.scene import Scene, View
from tests.synthetic_capture import CUBE_FACES, CUBE_VERTICES, HEIGHT, WIDTH, SyntheticCapture

PHOTO = ArrayPhoto(np.zeros((HEIGHT, WIDTH, 3), np.uint8))


def cube_views(n: int = 4, flip: np.ndarray | None = None) -> tuple[View, ...]:
    capture = SyntheticCapture()
    flip = np.eye(3) if flip is None else flip
    return tuple(View(capture.names[i], Camera(flip @ capture.matrix(i), WIDTH, HEIGHT), PHOTO) for i in range(n))


def test_welded_scene_gives_the_input_back():
    vertices = CUBE_VERTICES[CUBE_FACES].reshape(-1, 3)
    faces = np.arange(36).reshape(-1, 3)
    scene = Scene.build("soup", vertices, faces, cube_views())
    assert len(scene.mesh.vertices) == 8
    np.testing.assert_array_equal(scene.unweld(scene.mesh.vertices), vertices)
    np.testing.assert_array_equal(scene.original_faces, faces)
    np.testing.assert_array_equal(scene.mesh.vertices[scene.mesh.faces], vertices[faces])


def test_moving_a_welded_vertex_moves_all_its_copies():
    vertices = CUBE_VERTICES[CUBE_FACES].reshape(-1, 3)
    scene = Scene.build("soup", vertices, np.arange(36).reshape(-1, 3), cube_views())
    moved = scene.mesh.vertices.copy()
    corner = moved[0].copy()
    moved[0] += 1
    copies = (vertices == corner).all(axis=1)
    np.testing.assert_array_equal(scene.unweld(moved)[copies], np.tile(corner + 1, (copies.sum(), 1)))
    np.testing.assert_array_equal(scene.unweld(moved)[~copies], vertices[~copies])


def test_two_photos_are_too_few():
    with pytest.raises(InputError, match="at least 3 photos, found 2"):
        Scene.build("cube", CUBE_VERTICES, CUBE_FACES, cube_views(2))


def test_names_of_photos_are_unique():
    views = cube_views(3)
    with pytest.raises(InputError, match=r"two photos are named a\.png"):
        Scene.build("cube", CUBE_VERTICES, CUBE_FACES, (*views, views[0]))


def test_photo_of_another_size_than_its_camera_is_refused():
    with pytest.raises(InputError, match=r"photo a: .*96x72 pixels, the file has 72x96"):
        View(
            "a", Camera(SyntheticCapture().matrix(0), WIDTH, HEIGHT), ArrayPhoto(np.zeros((WIDTH, HEIGHT, 3), np.uint8))
        )


def test_mesh_in_view_passes():
    check_mesh_in_view(Scene.build("cube", CUBE_VERTICES, CUBE_FACES, cube_views()))


def test_mesh_outside_all_photos_is_refused():
    scene = Scene.build("cube", CUBE_VERTICES + 50, CUBE_FACES, cube_views())
    with pytest.raises(InputError, match="none of its 8 vertices lies inside any of the 4 photos"):
        check_mesh_in_view(scene)


def test_one_mirrored_matrix_is_named():
    views = (*cube_views(3), cube_views(4, flip=np.array([[1, 0, 0], [0, -1, HEIGHT - 1], [0, 0, 1.0]]))[3])
    scene = Scene.build("cube", CUBE_VERTICES, CUBE_FACES, views)
    with pytest.raises(InputError, match=r"camera of photo d\.png: .*mirrored"):
        check_mesh_in_view(scene)


def test_photo_file_is_decoded_as_rgb_only_when_loaded(tmp_path: Path):
    path = tmp_path / "p.png"
    Image.fromarray(np.full((4, 6), 7, np.uint8)).save(path)
    photo = FilePhoto(path)
    assert photo.size == (6, 4)
    assert photo.load().tolist() == np.full((4, 6, 3), 7).tolist()


@pytest.mark.parametrize("suffix", ["png", "jpg", "tif", "bmp"])
def test_truncated_photo_is_one_line_at_any_length(tmp_path: Path, suffix: str):
    path = tmp_path / f"p.{suffix}"
    Image.fromarray(np.random.default_rng(0).integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)).save(path)
    data = path.read_bytes()
    for length in np.linspace(0, len(data) * 0.9, 25).astype(int):
        path.write_bytes(data[:length])
        with pytest.raises(InputError, match="p." + suffix) as error:
            FilePhoto(path).load()
        assert "\n" not in str(error.value)
