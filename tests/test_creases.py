"""Creases: found where faces meet at an angle, measured against image edges, aligned with them."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import trimesh

from fairing.camera import Camera
from fairing.creases.alignment import aligned_to_image_edges
from fairing.creases.edges import MIN_ANGLE, Creases, find_creases
from fairing.creases.offsets import CONCAVE_WEIGHT, measure_offsets
from fairing.errors import Cancelled
from fairing.photo import ArrayPhoto
from fairing.scene import View

pytestmark = pytest.mark.compiled

SIZE = (200, 160)
K = np.array([[400.0, 0, 99.5], [0, 400.0, 79.5], [0, 0, 1]])
FINENESS = 8
ROOF = np.array(
    [[-0.5, -0.5, 4.4], [-0.5, 0.5, 4.4], [0.0, -0.5, 4.0], [0.0, 0.5, 4.0], [0.5, -0.5, 4.4], [0.5, 0.5, 4.4]]
)
ROOF_FACES = np.array([[0, 1, 2], [2, 1, 3], [2, 3, 4], [4, 3, 5]])
EYES = ((0.0, 0.0, 0.0), (0.5, 0.1, 0.0), (-0.5, -0.1, 0.1))


def camera_at(eye: tuple[float, float, float]) -> Camera:
    return Camera.from_krt(K, np.eye(3), -np.array(eye), *SIZE)


def photo_of(camera: Camera, vertices: np.ndarray) -> np.ndarray:
    """The roof with a dark and a bright face before a grey background, rays cast one by one."""
    width, height = camera.width * FINENESS, camera.height * FINENESS
    shift = (FINENESS - 1) / 2
    finer = np.array([[FINENESS, 0, shift], [0, FINENESS, shift], [0, 0, 1]]) @ camera.image_from_world
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    rays = np.stack([x, y, np.ones_like(x)], axis=-1) @ np.linalg.inv(finer[:, :3]).T
    grey, nearest = np.full((height, width), 120.0), np.full((height, width), np.inf)
    for face, (a, b, c) in enumerate(vertices[ROOF_FACES]):
        weights = rays @ np.linalg.inv(np.column_stack([a - camera.center, b - camera.center, c - camera.center])).T
        depth = 1 / weights.sum(axis=-1)
        hit = (weights >= 0).all(axis=-1) & (depth < nearest)
        grey[hit], nearest[hit] = (60.0 if face < 2 else 180.0), depth[hit]
    grey = grey.reshape(camera.height, FINENESS, camera.width, FINENESS).mean(axis=(1, 3))
    return np.repeat(np.rint(grey).astype(np.uint8)[..., None], 3, axis=2)


@pytest.fixture(scope="module")
def views() -> list[View]:
    cameras = [camera_at(eye) for eye in EYES]
    return [View(f"{k}", camera, ArrayPhoto(photo_of(camera, ROOF))) for k, camera in enumerate(cameras)]


def aligned(
    views: list[View],
    vertices: np.ndarray,
    locked: tuple[int, ...] = (0, 1, 4, 5),
    threads: int = 1,
    reach: float = 2.0,
    **changes,
):
    fixed = np.isin(np.arange(len(vertices)), locked)
    with ThreadPoolExecutor(threads) as pool:
        return aligned_to_image_edges(views, vertices, ROOF_FACES, fixed, 1, reach, pool, **changes)


def slow_creases(vertices: np.ndarray, faces: np.ndarray) -> dict[tuple[int, int], bool]:
    """Ends of every crease of a watertight mesh, and whether it is concave, by trimesh."""
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    bent = mesh.face_adjacency_angles > np.radians(MIN_ANGLE)
    ends = np.sort(mesh.face_adjacency_edges[bent], axis=1)
    return {(int(a), int(b)): not convex for (a, b), convex in zip(ends, mesh.face_adjacency_convex[bent], strict=True)}


def as_dict(creases: Creases) -> dict[tuple[int, int], bool]:
    return {(int(a), int(b)): bool(c) for (a, b), c in zip(creases.ends, creases.is_concave, strict=True)}


@pytest.mark.parametrize("shape", ["box", "annulus", "sphere", "step"])
def test_creases_are_those_of_trimesh(shape: str):
    make = {
        "box": lambda: trimesh.creation.box(),
        "annulus": lambda: trimesh.creation.annulus(0.4, 1, 1, sections=12),
        "sphere": lambda: trimesh.creation.icosphere(3),
        "step": lambda: trimesh.creation.extrude_triangulation(
            np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2.0]]),
            np.array([[0, 1, 3], [1, 2, 3], [0, 3, 5], [3, 4, 5]]),
            1.0,
        ),
    }[shape]()
    vertices, faces = np.array(make.vertices), np.array(make.faces)
    expected = slow_creases(vertices, faces)
    assert as_dict(find_creases(vertices, faces, 1)) == expected
    turned = find_creases(vertices, faces[:, ::-1], -1)
    assert as_dict(turned) == expected, "the photos show the other side of the faces"
    assert any(expected.values()) == (shape in ("annulus", "step"))


def test_an_edge_of_one_or_three_faces_is_no_crease():
    fin = np.vstack([ROOF, [0.0, 0.0, 3.0]])
    assert as_dict(find_creases(fin, ROOF_FACES, 1)) == {(2, 3): False}
    assert (2, 3) not in as_dict(find_creases(fin, np.vstack([ROOF_FACES, [2, 3, 6]]), 1))


@pytest.mark.parametrize("shift", [-1.3, -0.4, 0.0, 0.7, 1.6])
def test_the_offset_is_the_distance_to_the_image_edge(views: list[View], shift: float):
    """The crease is moved sideways by so many pixels of the first photo."""
    moved = ROOF.copy()
    moved[2:4, 0] += shift * ROOF[2, 2] / K[0, 0]
    creases = find_creases(moved, ROOF_FACES, 1)
    found = measure_offsets(views[0].photo.load(), views[0].camera, moved, ROOF_FACES, creases, 2.0)
    assert len(found.offset) >= 4
    sideways = found.px_per_move[:, 0]  # px to the side for a move by one unit along x
    assert np.abs(sideways) == pytest.approx(K[0, 0] / ROOF[2, 2], rel=1e-6)
    assert np.sign(sideways) * found.offset == pytest.approx(-shift * np.ones(len(found.offset)), abs=0.05)
    assert ((found.along > 0) & (found.along < 1) & (found.weight > 0)).all()


def test_nothing_is_measured_beyond_the_reach_without_contrast_or_where_hidden(views: list[View]):
    camera, creases = views[0].camera, find_creases(ROOF, ROOF_FACES, 1)
    photo = views[0].photo.load()

    def count(photo: np.ndarray, vertices: np.ndarray, faces: np.ndarray) -> int:
        return len(measure_offsets(photo, camera, vertices, faces, creases, 2.0).offset)

    away = ROOF.copy()
    away[2:4, 0] += 4.0 * ROOF[2, 2] / K[0, 0]
    assert count(photo, ROOF, ROOF_FACES) > 0
    assert count(photo, away, ROOF_FACES) == 0
    assert count(np.full_like(photo, 90), ROOF, ROOF_FACES) == 0
    wall = np.array([[-2, -2, 2], [2, -2, 2], [0, 3, 2.0]])
    assert count(photo, np.vstack([ROOF, wall]), np.vstack([ROOF_FACES, [6, 7, 8]])) == 0
    behind = ROOF * [1, 1, -1]
    assert count(photo, behind, ROOF_FACES) == 0


def test_a_concave_crease_counts_less(views: list[View]):
    creases = find_creases(ROOF, ROOF_FACES, 1)
    found, concave = (
        measure_offsets(views[0].photo.load(), views[0].camera, ROOF, ROOF_FACES, each, 2.0)
        for each in (creases, creases._replace(is_concave=np.array([True])))
    )
    assert concave.weight == pytest.approx(CONCAVE_WEIGHT * found.weight)


def test_alignment_brings_the_crease_back(views: list[View]):
    """Vertices 2 and 3 are moved across the crease, and the ends of the roof stay."""
    pixel = ROOF[2, 2] / K[0, 0]
    begun = ROOF.copy()
    begun[2, 0] += 1.2 * pixel
    begun[3, 0] -= 0.8 * pixel
    found = aligned(views, begun)
    error = np.abs(found.vertices - ROOF)[2:4, 0] / pixel
    assert error.max() < 0.25 < 0.8
    assert np.array_equal(found.vertices[[0, 1, 4, 5]], begun[[0, 1, 4, 5]])
    assert np.abs(found.vertices - begun)[2:4, 1].max() < 0.05 * pixel, "along the crease nothing moves"
    across, along = found.information[2:4, 0, 0], found.information[2:4, 1, 1]
    assert ((across * pixel**2 > 0.1) & (along < 1e-2 * across)).all()


def test_a_far_edge_is_found_within_the_reach(views: list[View]):
    pixel = ROOF[2, 2] / K[0, 0]
    begun = ROOF.copy()
    begun[2:4, 0] += 4.5 * pixel
    near, far = (np.abs(aligned(views, begun, reach=reach).vertices - ROOF)[2:4, 0] / pixel for reach in (2.0, 6.0))
    assert near.min() > 4
    assert far.max() < 0.5


def test_alignment_does_not_depend_on_threads_and_stops_when_cancelled(views: list[View]):
    begun = ROOF + np.array([0.004, 0.0, 0.002])
    one, several = aligned(views, begun, ()), aligned(views, begun, (), threads=3)
    assert all(np.array_equal(a, b) for a, b in zip(one, several, strict=True))

    def cancelled() -> None:
        raise Cancelled

    with pytest.raises(Cancelled):
        aligned(views, begun, (), raise_if_cancelled=cancelled)


def test_without_creases_or_free_vertices_nothing_happens(views: list[View]):
    flat = ROOF * [1, 1, 0] + [0, 0, 4.0]
    for vertices, locked in ((flat, ()), (ROOF + np.array([0.004, 0, 0]), tuple(range(6)))):
        found = aligned(views, vertices, locked)
        assert np.array_equal(found.vertices, vertices)
        assert not found.information.any()
