"""Steps against dense linear algebra and scipy's least squares on residuals computed by numpy and scipy alone."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.ndimage import map_coordinates, spline_filter
from scipy.optimize import least_squares
from scipy.sparse import csc_array

from fairing.geometry.normals import face_quality, folded_faces
from fairing.mesh import Mesh
from fairing.optimize.rows import Anchor
from fairing.options import StepOptions
from fairing.run.phases import Level
from fairing.run.session import Session
from fairing.run.stages import Photos
from fairing.run.sweep import begin_sweep
from fairing.run_plan import RunPlan
from fairing.solve.energy import Evaluator, FaceSystem
from fairing.solve.normal_equations import solve_jointly, solve_vertices, vertex_systems
from fairing.solve.problem import Problem
from fairing.stage_kind import StageKind
from tests.cell_cases import ALL_CORNERS, FACE_IDS, prepared, sample_points, sharp_options
from tests.small_scene import (
    FACES,
    VERTICES,
    cameras,
    corner_scene,
    on_the_faces,
    photos,
    small_options,
    sparse_points,
)

pytestmark = pytest.mark.compiled

SMOOTH = {"interpolation": ["cubic"], "weighting": "cell", "size": [32], "inset": [0.5]}


def random_systems(rng: np.random.Generator) -> FaceSystem:
    """Positive definite systems for the six faces of the corner."""
    root = rng.normal(size=(6, 9, 12))
    H, g = root @ root.transpose(0, 2, 1), rng.normal(size=(6, 9))
    nothing = np.zeros(6)
    return FaceSystem(FACE_IDS, nothing, nothing, H, g, nothing, nothing)


def dense(system: FaceSystem) -> tuple[np.ndarray, np.ndarray]:
    """The whole normal matrix (21, 21) and gradient (21,), added up entry by entry."""
    H, g = np.zeros((21, 21)), np.zeros(21)
    for f, face in enumerate(FACES):
        index = [3 * v + axis for v in face for axis in range(3)]
        for i in range(9):
            g[index[i]] += system.g[f, i]
            for j in range(9):
                H[index[i], index[j]] += system.H[f, i, j]
    return H, g


def test_vertex_systems_are_the_diagonal_blocks_of_the_whole():
    system = random_systems(np.random.default_rng(0))
    H, g = vertex_systems(Mesh(VERTICES, FACES), system)
    whole, gradient = dense(system)
    for v in range(7):
        block = slice(3 * v, 3 * v + 3)
        assert H[v] == pytest.approx(whole[block, block])
        assert g[v] == pytest.approx(gradient[block])


def test_vertices_are_solved_like_by_numpy():
    rng = np.random.default_rng(1)
    root = rng.normal(size=(5, 3, 4))
    H, g = root @ root.transpose(0, 2, 1), rng.normal(size=(5, 3))
    plain = solve_vertices(H, g, np.zeros(5))
    assert plain == pytest.approx(-np.linalg.solve(H, g[..., None])[..., 0])
    damped = solve_vertices(H, g, np.full(5, 0.3))
    largest = np.linalg.eigvalsh(H)[:, 2]
    expected = -np.linalg.solve(H + 0.3 * largest[:, None, None] * np.eye(3), g[..., None])[..., 0]
    assert damped == pytest.approx(expected)


def test_a_direction_without_information_is_left_alone():
    H = np.diag([4.0, 9.0, 0.0])[None]
    assert solve_vertices(H, np.array([[4.0, 9.0, 0.0]]), np.zeros(1))[0] == pytest.approx([-1, -1, 0])


@pytest.mark.parametrize("free", [[True] * 7, [True, False, True, True, False, False, True]])
def test_the_joint_step_solves_the_whole_system(free):
    free = np.array(free)
    system = random_systems(np.random.default_rng(2))
    root = np.random.default_rng(5).normal(size=(21, 21)) * (np.random.default_rng(6).random((21, 21)) < 0.3)
    others = root @ root.T
    H, g = dense(system)
    H += others
    gradient = g.reshape(7, 3)
    step = solve_jointly(Mesh(VERTICES, FACES), system, csc_array(others), gradient, free, 0.0)
    kept = np.repeat(free, 3)
    expected = np.zeros(21)
    expected[kept] = -np.linalg.solve(H[np.ix_(kept, kept)], g[kept])
    # The solver's own ridge is a millionth of the diagonal.
    assert step.reshape(-1) == pytest.approx(expected, rel=1e-3, abs=1e-4)
    assert not step[~free].any()


def test_damping_shortens_the_joint_step():
    system = random_systems(np.random.default_rng(3))
    mesh, nothing = Mesh(VERTICES, FACES), csc_array((21, 21))
    gradient = dense(system)[1].reshape(7, 3)
    lengths = [
        np.linalg.norm(solve_jointly(mesh, system, nothing, gradient, np.ones(7, bool), d)) for d in (0, 0.1, 1, 10)
    ]
    assert lengths == sorted(lengths, reverse=True)
    assert lengths[-1] < 0.2 * lengths[0]


def test_without_points_the_prior_to_the_start_acts_in_the_plane_and_along_the_edge():
    """Vertex 1 lies on the edge along x, vertex 2 inside the plane z = 1, vertex 0 in the corner."""
    problem, start = Problem(corner_scene(), small_options(), VERTICES), VERTICES + 0.01
    sweep = begin_sweep(problem, Level(0, prior=0.1), Photos(StageKind.PHOTOS, 1, 1), 0, VERTICES, start)
    (term,) = sweep.terms
    assert isinstance(term, Anchor)
    assert np.array_equal(term.places, start)
    assert sweep.system is not None
    strength = 0.1 * np.linalg.eigvalsh(vertex_systems(problem.scene.mesh, sweep.system)[0])[:, 2]
    x, y, _ = np.eye(3)
    expected = {0: np.zeros((3, 3)), 1: np.outer(x, x), 2: np.outer(x, x) + np.outer(y, y)}
    for vertex, directions in expected.items():
        assert term.precision[vertex] == pytest.approx(strength[vertex] * directions, abs=1e-6 * strength[vertex])


def test_flips_folds_and_collapses_are_found():
    options = StepOptions()

    def after(v: int, place: list[float]) -> np.ndarray:
        moved = VERTICES.copy()
        moved[v] = place
        return moved

    def folded(end: np.ndarray) -> list[int]:
        return np.flatnonzero(folded_faces(VERTICES, end, VERTICES, FACES, options)).tolist()

    assert folded(VERTICES) == []
    assert folded(after(2, [0.1, 0.1, 1.0])) == []
    assert folded(after(2, [0.5, 1.5, 1.0])) == [0]  # over the diagonal, in the plane: turned over
    assert folded(after(2, [0.5, 0.99, 1.0])) == [0]  # onto its opposite edge
    assert 0 in folded(after(1, [0.999, 0.999, 1.0]))  # onto vertex 0
    thin = face_quality(after(1, [0.999, 0.999, 1.0]), FACES)[0]
    assert thin < options.min_quality


def residual_of(session: Session, sweep, face: int, corner_place: np.ndarray) -> np.ndarray:
    """(n, p) float: the cells of a face with vertex 0 elsewhere, read by scipy's spline, before any reconstruction."""
    bary = sample_points(session, sweep, face)
    corners = session.vertices[FACES[face]].copy()
    corners[FACES[face] == 0] = corner_place
    data, cells = sweep.context.kernel, []
    for pair in range(data.pair_start[face], data.pair_start[face + 1]):
        uv, _ = session.scene.views[data.pair_view[pair]].camera.project(bary @ corners)
        photo = blurred_photo(int(data.pair_view[pair]), session.options.levels[0].blur)
        cells.append(map_coordinates(photo, [uv[:, 1], uv[:, 0]], order=3, mode="mirror", prefilter=False))
    return np.array(cells)


_splines: dict[tuple[int, float], np.ndarray] = {}


def blurred_photo(view: int, blur: float) -> np.ndarray:
    """Spline coefficients of a smoothed photo."""
    if (view, blur) not in _splines:
        grey = photos()[view][..., 0].astype(np.float64)
        size = 2 * int(np.ceil(4 * blur)) + 1
        smooth = cv2.GaussianBlur(grey, (size, size), blur, borderType=cv2.BORDER_REFLECT_101)
        _splines[view, blur] = spline_filter(smooth, order=3, mode="mirror")
    return _splines[view, blur]


def low_rank(cells: np.ndarray, k: int) -> np.ndarray:
    U, s, Vt = np.linalg.svd(cells, full_matrices=False)
    return (U[:, :k] * s[:k]) @ Vt[:k]


def test_an_alternating_step_is_scipy_s_gauss_newton_step_with_the_eigenspace_held_fixed():
    session, sweep = prepared(sharp_options(cells=SMOOTH, eigenspace={"dimensions": [2]}))
    start = session.vertices[0]
    fixed = [low_rank(residual_of(session, sweep, f, start), 2) for f in range(6)]

    def residuals(place: np.ndarray) -> np.ndarray:
        return np.concatenate(
            [(residual_of(session, sweep, f, place) - fixed[f]).ravel() / sweep.sigma[f] for f in range(6)]
        )

    found = least_squares(residuals, start, jac="3-point", diff_step=1e-5, max_nfev=1)
    expected = -np.linalg.solve(found.jac.T @ found.jac, found.grad)
    system = Evaluator(1).linearise(sweep.context, session.vertices, FACE_IDS, ALL_CORNERS, sweep.scale, "alternating")
    H, g = vertex_systems(session.scene.mesh, system)
    # The kernel's rho is e^2 / sigma^2, twice scipy's half squares.
    assert H[0] == pytest.approx(2 * found.jac.T @ found.jac, rel=2e-3)
    step = solve_vertices(H[:1], g[:1], np.zeros(1))[0]
    assert step == pytest.approx(expected, rel=0.02)


def test_a_variable_projection_step_is_scipy_s_step_on_the_refitted_residual():
    """Near the solution, where Kaufman's simplification (which drops terms with the residual) is good."""
    displacement = (0.006, -0.004, 0.005)
    session, sweep = prepared(sharp_options(cells=SMOOTH, eigenspace={"dimensions": [1]}), displacement=displacement)
    start = session.vertices[0]

    def residuals(place: np.ndarray) -> np.ndarray:
        cells = [residual_of(session, sweep, f, place) for f in range(6)]
        return np.concatenate([((c - low_rank(c, 1)) / s).ravel() for c, s in zip(cells, sweep.sigma, strict=True)])

    found = least_squares(residuals, start, jac="3-point", diff_step=1e-5, max_nfev=1)
    expected = -np.linalg.solve(found.jac.T @ found.jac, found.grad)
    steps = {}
    for solver in ("alternating", "variable_projection"):
        system = Evaluator(1).linearise(sweep.context, session.vertices, FACE_IDS, ALL_CORNERS, sweep.scale, solver)
        H, g = vertex_systems(session.scene.mesh, system)
        steps[solver] = solve_vertices(H[:1], g[:1], np.zeros(1))[0]
    length = np.linalg.norm(expected)
    assert np.linalg.norm(steps["variable_projection"] - expected) < 0.1 * length
    assert np.linalg.norm(steps["variable_projection"]) > 1.5 * np.linalg.norm(steps["alternating"])


def test_a_run_ends_where_scipy_finds_the_minimum():
    options = small_options(
        schedule={"blur": [1.0], "max_sweeps": [1], "max_iterations": [40]},
        cells=SMOOTH,
        eigenspace={"dimensions": [1]},
        robust={"norm": "least_squares", "sigma_rule": ["fixed"]},
        step={"prior": 0.0, "tolerance": 0.0},
        locked_vertices=(1, 2, 3, 4, 5, 6),
    )
    session, sweep = prepared(options, displacement=(0.01, -0.02, 0.015))
    session.run()
    end = session.vertices[0]

    def residuals(place: np.ndarray) -> np.ndarray:
        cells = [residual_of(session, sweep, f, place) for f in range(6)]
        return np.concatenate([(c - low_rank(c, 1)).ravel() for c in cells])

    found = least_squares(residuals, end, diff_step=1e-5, xtol=1e-10)
    # 60 px an edge: 1e-5 edges are 0.0006 px; the kernel's float32 cells resolve about that.
    assert np.linalg.norm(found.x - end) < 3e-5


def test_near_points_a_vertex_without_texture_around_it_does_not_drift():
    """All faces around vertex 2 lie in the side z = 1, painted grey and without points; photos have noise."""
    rng, painted = np.random.default_rng(8), {}
    for i, (photo, camera) in enumerate(zip(photos(), cameras(), strict=True)):
        outline = np.rint(camera.project(VERTICES[:4])[0]).astype(np.int32)
        side = cv2.fillConvexPoly(np.zeros(photo.shape[:2], np.uint8), outline, 1)
        noisy = np.where(side > 0, 120, photo[..., 0]) + 0.2 * rng.standard_normal(side.shape)
        painted[i] = np.repeat(np.clip(np.rint(noisy), 0, 255).astype(np.uint8)[..., None], 3, axis=2)
    points = on_the_faces(600)
    scene = replace(corner_scene(change=painted), sparse_points=sparse_points(points[points[:, 2] < 0.999]))
    plan = RunPlan(1, False, is_fitted_to_points=True, represents_surface=True)
    moved = []
    for prior in (0.0, StepOptions().prior):
        session = Session(scene, small_options(step={"points": [0.3], "prior": prior}))
        session.trace.plan = plan
        session.run()
        places = np.array([session.vertices[2], VERTICES[2]])
        moved.append(max(float(np.linalg.norm(np.subtract(*camera.project(places)[0]))) for camera in cameras()))
    assert moved[0] > 2
    assert moved[1] < 0.5
