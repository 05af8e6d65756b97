"""Manhattan frame: relations of what follows the axes of a building, none for other shapes, and straightening by them."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.optimize import minimize

from fairing.run.stages import ROUNDS
from fairing.terms.axes import ANGLE, FAR, FAR_INFORMATION, SCALE, related, relations
from tests.fit_of_points import straightened, straightened_from_afar
from tests.square_loss import Square

PIXEL = 0.05  # world units: an edge of a cube has 20 px
TURN = trimesh.transformations.rotation_matrix(0.7, [1, 2, 3])[:3, :3]


def building(filled: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of the surface of the cubes at `filled` (a, b, c) bool, one unit wide, turned away from the axes."""
    corners, quads = [], []
    around = np.pad(filled, 1)
    for cube in np.argwhere(filled):
        for axis in range(3):
            for end in (0, 1):
                beside = cube + 1
                beside[axis] += 2 * end - 1
                if not around[tuple(beside)]:
                    square = np.tile(cube, (4, 1))
                    square[:, axis] += end
                    square[[1, 2], (axis + 1) % 3] += 1
                    square[[2, 3], (axis + 2) % 3] += 1
                    quads.append(np.arange(4)[:: 2 * end - 1] + 4 * len(quads))
                    corners.append(square)
    triangles = np.concatenate([np.array(quads)[:, [0, 1, 2]], np.array(quads)[:, [0, 2, 3]]])
    mesh = trimesh.Trimesh(np.concatenate(corners).astype(float), triangles, process=False)
    mesh.merge_vertices()
    return np.asarray(mesh.vertices) @ TURN.T, np.asarray(mesh.faces)


@pytest.fixture
def tower() -> tuple[np.ndarray, np.ndarray]:
    """A wall with a recess and a tower."""
    filled = np.ones((6, 4, 2), dtype=bool)
    filled[1:3, 1:3, 1] = False
    filled[4:, :2, 1] = False
    return building(filled)


def noisy(vertices: np.ndarray, px: float, seed: int = 0) -> np.ndarray:
    return vertices + px * PIXEL * np.random.default_rng(seed).standard_normal(vertices.shape)


def pixels(vertices: np.ndarray) -> np.ndarray:
    return np.full(len(vertices), PIXEL)


def unlocked(vertices: np.ndarray) -> np.ndarray:
    return np.zeros(len(vertices), dtype=bool)


def px_off(vertices: np.ndarray, truth: np.ndarray) -> float:
    return float(np.linalg.norm(vertices - truth, axis=1).mean() / PIXEL)


def test_relations_are_all_edges_and_faces_along_the_axes(tower):
    vertices, faces = tower
    found = relations(vertices, faces, pixels(vertices))
    expected = set()
    edges = {tuple(sorted(pair)) for face in faces.tolist() for pair in zip(face, face[1:] + face[:1], strict=True)}
    for a, b in edges:
        along = np.abs(TURN.T @ (vertices[b] - vertices[a]))
        if np.sort(along)[1] < 1e-9:  # not a diagonal of a square
            expected |= {(a, b, axis) for axis in np.flatnonzero(along < 1e-9).tolist()}
    for face in faces.tolist():
        flat = int(np.ptp(vertices[face] @ TURN, axis=0).argmin())
        expected |= {(min(a, b), max(a, b), flat) for a, b in zip(face, face[1:] + face[:1], strict=True)}
    axes = np.abs(found.directions @ TURN)
    assert np.allclose(np.sort(axes, axis=1), [0, 0, 1 / PIXEL], atol=1e-9)
    result = {
        (min(a, b), max(a, b), int(axis))
        for (a, b), axis in zip(found.pairs.tolist(), axes.argmax(axis=1), strict=True)
    }
    assert result == expected


def test_straightening_removes_noise_of_a_building(tower):
    vertices, faces = tower
    start = noisy(vertices, 0.6)
    result = straightened(start, faces, unlocked(vertices), pixels(vertices))
    assert px_off(result, vertices) < 0.6 * px_off(start, vertices)


def test_a_vertex_that_slid_along_an_axis_goes_back(tower):
    vertices, faces = tower
    left = []
    for corner in range(0, len(vertices), 5):
        start = vertices.copy()
        start[corner] += 1.5 * PIXEL * TURN[:, corner % 3]
        result = straightened(start, faces, unlocked(vertices), pixels(vertices))
        left.append(px_off(result[[corner]], vertices[[corner]]) / 1.5)
    assert np.mean(left) < 0.35
    assert max(left) < 0.6


def test_edges_that_follow_no_axis_keep_their_direction(tower):
    vertices, faces = tower
    sheared = vertices.copy()
    roof = (vertices @ TURN)[:, 0] > 5.5
    sheared[roof] += 0.5 * TURN[:, 0] * (vertices @ TURN)[roof, 1:2]  # a slope of 27 degrees
    result = straightened(sheared, faces, unlocked(vertices), pixels(vertices))
    assert np.abs(result - sheared).max() < 0.05 * PIXEL


def half_determined(tower, px: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The tower's vertices with noise on every second one, (n,) bool those, and (n, 3, 3) float: what points tell of the others."""
    vertices, _ = tower
    is_off = np.arange(len(vertices)) % 2 == 0
    start = np.where(is_off[:, None], noisy(vertices, px, 3), vertices)
    return start, is_off, np.where(is_off[:, None, None], 0.0, np.eye(3))


def test_vertices_without_points_go_back_from_afar(tower):
    vertices, faces = tower
    start, is_off, information = half_determined(tower, 4.0)
    result = straightened_from_afar(start, faces, unlocked(vertices), pixels(vertices), information, 8.0)
    near_alone = straightened(start, faces, unlocked(vertices), pixels(vertices))
    before = px_off(start[is_off], vertices[is_off])
    assert px_off(result[is_off], vertices[is_off]) < 0.3 * before
    assert px_off(near_alone[is_off], vertices[is_off]) > 0.5 * before
    assert px_off(result[~is_off], vertices[~is_off]) < 0.5


def test_from_afar_is_where_the_energy_of_relations_and_positions_is_least(tower):
    vertices, faces = tower
    error = 4.0
    start, is_off, information = half_determined(tower, 2.0)
    result = straightened_from_afar(start, faces, unlocked(vertices), pixels(vertices), information, error)
    found = relations(result, faces, pixels(vertices), error / 2 ** (ROUNDS - 1))
    matrix, precision = (
        related(found, start).matrix(len(vertices)),
        FAR_INFORMATION * ~is_off + (FAR / error) ** 2,
    )

    def energy(px: np.ndarray) -> tuple[float, np.ndarray]:
        """Of moves (3 n,) from the start, px, and its gradient: Geman-McClure losses of the relations, squares of the moves."""
        residual = matrix @ (start.ravel() + PIXEL * px)
        loss, slope = residual**2 / (1 + (residual / SCALE) ** 2), residual / (1 + (residual / SCALE) ** 2) ** 2
        own = np.repeat(precision, 3)
        return float(loss.sum() + (own * px**2).sum()) / 2, PIXEL * (matrix.T @ slope) + own * px

    px = ((result - start) / PIXEL).ravel()
    best = minimize(energy, px, jac=True, method="L-BFGS-B", options={"maxiter": 2000, "ftol": 1e-14, "gtol": 1e-9})
    assert np.abs(best.x - px).max() < 0.05
    assert energy(px)[0] < 0.1 * energy(np.zeros_like(px))[0]


def test_points_hold_what_follows_no_axis(tower):
    vertices, faces = tower
    sheared = vertices.copy()
    roof = (vertices @ TURN)[:, 0] > 5.5
    sheared[roof] += 0.4 * TURN[:, 0] * (vertices @ TURN)[roof, 1:2]  # a slope of 22 degrees
    known, unknown = np.tile(np.eye(3), (len(vertices), 1, 1)), np.zeros((len(vertices), 3, 3))
    held, free, near = (
        straightened_from_afar(sheared, faces, unlocked(vertices), pixels(vertices), information, error)
        for information, error in ((known, 6.0), (unknown, 6.0), (unknown, 0.0))
    )
    assert px_off(held, sheared) < 0.2 * px_off(free, sheared)
    assert np.abs(near - sheared).max() < 0.05 * PIXEL


def test_from_afar_locked_vertices_and_those_without_a_pixel_stay(tower):
    vertices, faces = tower
    start, pixel, locked = noisy(vertices, 0.6), pixels(vertices), unlocked(vertices)
    locked[::7] = True
    pixel[1::7] = np.nan
    result = straightened_from_afar(start, faces, locked, pixel, np.zeros((len(vertices), 3, 3)), 6.0)
    stays = locked | np.isnan(pixel)
    assert (result[stays] == start[stays]).all()
    assert (result[~stays] != start[~stays]).any(axis=1).mean() > 0.9


@pytest.mark.parametrize("shape", ["sphere", "noise", "terrain", "cylinder"])
def test_other_shapes_have_no_relations(shape):
    random = np.random.default_rng(1)
    if shape == "sphere":
        mesh = trimesh.creation.icosphere(3, 3.0)
    elif shape == "cylinder":
        mesh = trimesh.creation.cylinder(2.0, 0.8, sections=40)
    else:
        x, y = np.meshgrid(np.arange(15.0), np.arange(15.0), indexing="ij")
        x, y = x + 0.3 * random.standard_normal(x.shape), y + 0.3 * random.standard_normal(x.shape)
        z = 0.3 * random.standard_normal(x.shape) if shape == "noise" else np.sin(x / 2) * np.cos(y / 3)
        mesh = trimesh.Trimesh(np.column_stack([x.ravel(), y.ravel(), z.ravel()]), _grid(15), process=False)
    vertices = np.asarray(mesh.vertices)
    assert len(relations(vertices, np.asarray(mesh.faces), pixels(vertices)).pairs) == 0
    result = straightened(vertices, np.asarray(mesh.faces), unlocked(vertices), pixels(vertices))
    assert (result == vertices).all()
    nothing = np.zeros((len(vertices), 3, 3))
    result = straightened_from_afar(
        vertices, np.asarray(mesh.faces), unlocked(vertices), pixels(vertices), nothing, 8.0
    )
    assert (result == vertices).all()


def test_meshes_without_two_walls_have_none():
    vertices = np.column_stack([np.mgrid[:5, :5].reshape(2, -1).T.astype(float), np.zeros(25)])
    assert len(relations(vertices, _grid(5), pixels(vertices)).pairs) == 0
    nothing = np.full(25, np.nan)
    assert len(relations(vertices, _grid(5), nothing).pairs) == 0


def test_locked_vertices_and_those_without_a_pixel_stay(tower):
    vertices, faces = tower
    start, pixel, locked = noisy(vertices, 0.6), pixels(vertices), unlocked(vertices)
    locked[::7] = True
    pixel[1::7] = np.nan
    result = straightened(start, faces, locked, pixel)
    stays = locked | np.isnan(pixel)
    assert (result[stays] == start[stays]).all()
    assert (result[~stays] != start[~stays]).any(axis=1).mean() > 0.9


def test_hessians_are_second_derivatives_of_the_differences(tower):
    vertices, faces = tower
    found = relations(noisy(vertices, 0.3), faces, pixels(vertices))
    weights = np.random.default_rng(2).uniform(size=len(found.pairs))
    rows = replace(related(found, vertices), information=weights, loss=Square())
    matrix = rows.matrix(len(vertices))

    def energy(places: np.ndarray) -> float:
        return float(0.5 * (weights * (matrix @ places.ravel()) ** 2).sum())

    H, step = rows.hessians(vertices), 1e-3
    for vertex in (0, 17, 40):
        for i in range(3):
            for j in range(3):
                second = 0.0
                for a, b in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
                    places = vertices.copy()
                    places[vertex, i] += a * step
                    places[vertex, j] += b * step
                    second += a * b * energy(places) / (4 * step**2)
                assert second == pytest.approx(H[vertex, i, j], rel=1e-4, abs=1e-3)
    a, b = found.pairs[5]
    assert (matrix @ vertices.ravel())[5] == pytest.approx(float((vertices[b] - vertices[a]) @ found.directions[5]))


def test_large_differences_count_for_little(tower):
    vertices, faces = tower
    rows = related(relations(vertices, faces, pixels(vertices)), vertices)
    assert (rows.information == 1).all()
    weights = rows.loss.weight(np.array([0.0, SCALE, 10 * SCALE]))
    assert weights[0] == 1
    assert weights[1] == 0.25
    assert weights[2] < 2e-4
    assert ANGLE < 45


def _grid(side: int) -> np.ndarray:
    index = np.arange(side * side).reshape(side, side)
    a, b, c, d = (i.ravel() for i in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    return np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
