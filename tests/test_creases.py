"""Creases: found where faces meet at an angle, measured against image edges, drawn to them by their term."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import trimesh

from fairing.camera import Camera
from fairing.creases.edges import MIN_ANGLE, Creases, find_creases
from fairing.creases.offsets import CONCAVE_WEIGHT, measure_offsets
from fairing.errors import Cancelled
from fairing.optimize.iteration import iterate
from fairing.optimize.rows import Anchor, Rows
from fairing.photo import ArrayPhoto
from fairing.scene import View
from fairing.solve.problem import CancellablePool
from fairing.terms.image_edges import SEARCHES, image_edges
from tests.fit_of_points import guard_of

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


def drawn(views: list[View], begun: np.ndarray, first: int) -> np.ndarray:
    """(n, 3) float: vertices after sweeps with the searches from `first` on; the ends of the roof stay."""
    pixel, vertices = begun[2, 2] / K[0, 0], begun
    weak = Anchor("start", np.tile(1e-3 / pixel**2 * np.eye(3), (len(begun), 1, 1)), begun)
    for search in SEARCHES[first:]:
        with ThreadPoolExecutor(1) as pool:
            edges = image_edges(views, vertices, ROOF_FACES, 1, search, pool)
        for _ in range(6):
            done = iterate((edges, weak), vertices, np.array([2, 3]), guard_of(begun, ROOF_FACES))
            assert done.accepted
            vertices = done.after
    return vertices


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
    # A parabola through profiles every 0.5 px is up to 0.05 px off, and single precision a little more.
    assert np.sign(sideways) * found.offset == pytest.approx(-shift * np.ones(len(found.offset)), abs=0.05001)
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


def test_offsets_in_noise_weigh_as_the_reciprocal_of_their_variance(views: list[View]):
    """The variance over many draws of the noise."""
    photo, creases = views[0].photo.load().astype(np.float32), find_creases(ROOF, ROOF_FACES, 1)
    products = []
    for noise in (40, 60):
        found = []
        for seed in range(30):
            noisy = photo + noise * np.random.default_rng(seed).standard_normal(photo.shape, dtype=np.float32)
            found.append(measure_offsets(noisy, views[0].camera, ROOF, ROOF_FACES, creases, 2.0))
        offset, weight = (np.concatenate([getattr(each, name) for each in found]) for name in ("offset", "weight"))
        assert weight.mean() < 0.8
        products.append(weight.mean() * np.median(np.abs(offset)) ** 2)
    assert products[0] == pytest.approx(products[1], rel=0.25)  # 1.6 times as much if weights fell as the error itself


def test_the_term_is_that_of_the_offsets_of_all_photos(views: list[View]):
    """A move across the crease by a pixel changes the residual by a pixel where the whole crease makes it."""
    moved = ROOF.copy()
    moved[2:4, 0] += 0.7 * ROOF[2, 2] / K[0, 0]
    reach, scale = SEARCHES[-1]
    with ThreadPoolExecutor(1) as pool:
        term = image_edges(views, moved, ROOF_FACES, 1, (reach, scale), pool)
    creases = find_creases(moved, ROOF_FACES, 1)
    each = [measure_offsets(v.photo.load(), v.camera, moved, ROOF_FACES, creases, reach) for v in views]
    offsets, weights = (np.concatenate([getattr(one, name) for one in each]) for name in ("offset", "weight"))
    assert term.residuals_at(moved) == pytest.approx(-offsets)
    assert term.weights_at(moved) == pytest.approx(weights / (1 + (offsets / scale) ** 2) ** 2)
    assert np.abs(term.residuals_at(ROOF)).max() < 0.25 < 0.6 < np.abs(term.residuals_at(moved)).min()


def test_the_term_draws_the_crease_back(views: list[View]):
    """Vertices 2 and 3 are moved across the crease."""
    pixel = ROOF[2, 2] / K[0, 0]
    begun = ROOF.copy()
    begun[2, 0] += 1.2 * pixel
    begun[3, 0] -= 0.8 * pixel
    found = drawn(views, begun, 2)
    assert (np.abs(found - ROOF)[2:4, 0] / pixel).max() < 0.25
    assert np.abs(found - begun)[2:4, 1].max() < 0.05 * pixel, "along the crease nothing moves"


def test_a_far_edge_is_found_by_the_wide_searches(views: list[View]):
    pixel = ROOF[2, 2] / K[0, 0]
    begun = ROOF.copy()
    begun[2:4, 0] += 4.5 * pixel
    near, far = (np.abs(drawn(views, begun, first) - ROOF)[2:4, 0] / pixel for first in (2, 0))
    assert near.min() > 4
    assert far.max() < 0.5


def test_the_term_does_not_depend_on_threads_and_stops_when_cancelled(views: list[View]):
    def term(threads: int, check: Callable[[], None] = lambda: None) -> Rows:
        with ThreadPoolExecutor(threads) as pool:
            moved = ROOF + np.array([0.004, 0.0, 0.002])
            return image_edges(views, moved, ROOF_FACES, 1, SEARCHES[-1], CancellablePool(pool, check))

    one, several = term(1), term(3)
    for name in ("ids", "derivatives", "residuals", "information"):
        assert np.array_equal(getattr(one, name), getattr(several, name))

    def cancelled() -> None:
        raise Cancelled

    with pytest.raises(Cancelled):
        term(1, cancelled)


def test_without_creases_the_term_is_empty(views: list[View]):
    flat = ROOF * [1, 1, 0] + [0, 0, 4.0]
    with ThreadPoolExecutor(1) as pool:
        term = image_edges(views, flat, ROOF_FACES, 1, SEARCHES[0], pool)
    assert len(term.residuals) == 0
    assert term.total(ROOF) == 0
    assert not term.linearise(ROOF).gradient.any()
