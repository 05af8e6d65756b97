"""The initial camera: it sees the faulty part of the mesh from the middle of the photos' directions."""

import numpy as np
import pytest

from app.stage import Stage
from demo_scenes import load_demo
from fairing.scene import Scene
from tests.small_scene import corner_scene


def first_direction(stage: Stage) -> np.ndarray:
    return (stage.eye - stage.target) / np.linalg.norm(stage.eye - stage.target)


def facing(scene: Scene, direction: np.ndarray) -> np.ndarray:
    """(m,) float: cosine between each face's normal, towards the cameras, and a direction."""
    corners = scene.mesh.vertices[scene.mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    centers = np.array([view.camera.center for view in scene.views])
    outward = np.sign(np.einsum("mc,mc->m", normals, centers.mean(0) - corners.mean(1)))
    return outward * (normals @ direction)


def test_the_cube_opens_with_all_faces_around_the_wrong_corner_towards_the_viewer():
    scene = load_demo("cube")
    direction = first_direction(Stage.of(scene))
    assert scene.truth is not None
    assert scene.truth.vertices is not None
    wrong = int(np.linalg.norm(scene.mesh.vertices - scene.truth.vertices, axis=1).argmax())
    assert facing(scene, direction)[scene.mesh.one_rings[wrong]].min() > 0.3
    assert facing(scene, direction).min() > 0.2


@pytest.mark.slow
@pytest.mark.parametrize("name", ["facade", "archway", "dome"])
def test_the_other_demos_open_in_the_middle_of_the_photos(name):
    scene = load_demo(name)
    stage = Stage.of(scene)
    towards = stage.camera_centers / np.linalg.norm(stage.camera_centers, axis=1, keepdims=True)
    mean = towards.mean(0) / np.linalg.norm(towards.mean(0))
    assert first_direction(stage) @ mean > 0.85
    assert (facing(scene, first_direction(stage)) > 0).mean() > 0.5


def test_a_mesh_in_a_ring_of_cameras_is_seen_from_one_of_them():
    scene = corner_scene()
    angles = np.linspace(0, 2 * np.pi, 8, endpoint=False)
    stage = Stage.of(scene)
    directions = np.stack([np.cos(angles), np.sin(angles), np.zeros(8)], axis=1)
    from app.stage import _first_direction

    chosen = _first_direction(scene, directions, np.array([0.0, 0.0, 1.0]))
    assert (directions @ chosen).max() == pytest.approx(1)
    assert np.isfinite(stage.eye).all()


def test_a_view_straight_down_is_tilted_so_that_it_has_a_roll():
    from app.stage import _first_direction

    down = np.tile([0.0, 0.0, 1.0], (4, 1))
    chosen = _first_direction(corner_scene(), down, np.array([0.0, 0.0, 1.0]))
    assert 0.04 < np.linalg.norm(np.cross(chosen, [0, 0, 1])) < 0.3
