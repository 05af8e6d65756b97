"""Fit of a mesh to sparse points, and runs with sparse points."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from fairing.errors import InputError
from fairing.geometry.normals import face_normals
from fairing.judge.report import run_report
from fairing.mesh import Mesh
from fairing.optimize.rows import Rows
from fairing.options import FINE_BLUR, PRESETS, FairingOptions
from fairing.run.fits import points_on_mesh
from fairing.run.phases import Level
from fairing.run.planning import FAR_ERROR, points_accept_smoothing
from fairing.run.records import held_out_points_prefer
from fairing.run.session import Session
from fairing.run.stages import Photos
from fairing.run.sweep import RESIDUAL_AREA, SweepState, begin_sweep
from fairing.scene import Scene
from fairing.solve.normal_equations import vertex_systems
from fairing.solve.point_split import fitting_points, held_out_points, observed_fitting_points, observed_held_out_points
from fairing.solve.problem import Problem
from fairing.stage_kind import StageKind
from fairing.terms.closest_points import closest_points
from fairing.trace import StepReason, Trace
from tests.fit_of_points import closest_fit
from tests.prior_to_start import origin_of
from tests.small_scene import (
    FACES,
    START,
    VERTICES,
    corner_scene,
    observed,
    on_the_faces,
    photos,
    small_options,
    sparse_points,
)

USED = {"points": [0.3]}
FAR = tuple(2.5 * x for x in START)


def with_points(points: np.ndarray, displaced: tuple[float, ...] = FAR) -> Scene:
    """The corner with these points, each both to fit to and to judge by."""
    return replace(corner_scene(displaced), sparse_points=sparse_points(np.repeat(points, 2, axis=0)))


def problem_of(scene: Scene, options: FairingOptions | None = None) -> Problem:
    return Problem(scene, options or small_options(), scene.mesh.vertices)


def error_of(vertices: np.ndarray) -> float:
    return float(np.linalg.norm(vertices[0] - VERTICES[0]))


def test_points_are_halved_and_none_is_in_both_halves():
    positions = np.random.default_rng(1).standard_normal((7, 3))
    scene = replace(corner_scene(), sparse_points=sparse_points(positions))
    assert np.array_equal(fitting_points(scene), positions[[0, 2, 4, 6]])
    assert np.array_equal(held_out_points(scene), positions[[1, 3, 5]])
    assert len(fitting_points(corner_scene())) == len(held_out_points(corner_scene())) == 0


def test_points_at_vertices_of_the_start_are_not_held_out():
    start = corner_scene().mesh
    positions = np.repeat(on_the_faces(60), 2, axis=0)
    positions[[7, 8]] = start.vertices[[2, 3]].astype(np.float32)  # as a mesh file rounds them
    scene = observed(corner_scene(), positions)
    twice = scene.sparse_positions
    assert np.array_equal(held_out_points(scene), twice[[p for p in range(1, len(twice), 2) if p not in (15, 17)]])
    assert len(observed_held_out_points(scene)) == len(held_out_points(scene))
    assert len(observed_fitting_points(scene)) == len(fitting_points(scene)) == len(positions)


def test_a_displaced_vertex_moves_to_the_corner_of_the_points():
    scene = with_points(on_the_faces())
    found = closest_fit(problem_of(scene), scene.mesh.vertices, 12).places
    # The regularization keeps some of the error.
    assert error_of(found) < 0.1 * error_of(scene.mesh.vertices)


def test_outliers_among_the_points_hardly_matter():
    points = on_the_faces()
    wrong = np.random.default_rng(2).random(len(points)) < 0.15
    points[wrong] += np.random.default_rng(3).uniform(-0.4, 0.4, (wrong.sum(), 3))
    scene = with_points(points)
    found = closest_fit(problem_of(scene), scene.mesh.vertices, 12).places
    assert error_of(found) < 0.2 * error_of(scene.mesh.vertices)


def test_vertices_without_points_and_locked_vertices_stay():
    points = on_the_faces()
    # Only of the two faces in z = 1, well inside: vertices 4, 5 and 6 are corners of neither.
    points = points[(points[:, 2] > 0.999) & (points[:, :2].max(axis=1) < 0.8)]
    scene = with_points(points)
    found = closest_fit(problem_of(scene), scene.mesh.vertices, 4)
    assert np.array_equal(found.places[[4, 5, 6]], scene.mesh.vertices[[4, 5, 6]])
    assert not found.precision[[4, 5, 6]].any()
    assert not np.array_equal(found.places[0], scene.mesh.vertices[0])
    locked = problem_of(scene, replace(small_options(), locked_vertices=(0,)))
    assert np.array_equal(closest_fit(locked, scene.mesh.vertices, 4).places[0], scene.mesh.vertices[0])


def test_the_hessians_are_the_sum_of_the_normal_equations_of_the_points():
    points = on_the_faces(60)
    scene = with_points(points, (0, 0, 0))
    normals = face_normals(VERTICES, FACES)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    H = np.zeros((21, 21))
    for i, point in enumerate(points):
        f = i % len(FACES)
        weights = np.linalg.lstsq(np.vstack([VERTICES[FACES[f]].T, np.ones(3)]), np.append(point, 1), rcond=None)[0]
        row = np.zeros(21)
        for corner, weight in zip(FACES[f], weights, strict=True):
            row[3 * corner : 3 * corner + 3] = weight * normals[f]
        H += np.outer(row, row)
    average = np.diag(H)[np.diag(H) > 0].mean()
    found = closest_fit(problem_of(scene), VERTICES, 1)
    for v in range(7):
        assert found.precision[v] == pytest.approx(H[3 * v : 3 * v + 3, 3 * v : 3 * v + 3] / average, abs=1e-9)


def test_no_face_folds_however_the_points_lie():
    heap = np.random.default_rng(4).uniform(-0.5, 1.5, (400, 3))
    scene = with_points(heap)
    found = closest_fit(problem_of(scene), scene.mesh.vertices, 12).places
    start = face_normals(scene.mesh.vertices, FACES)
    assert ((start * face_normals(found, FACES)).sum(axis=1) > 0).all()


def test_a_run_begins_at_the_points_where_the_photos_agree():
    session = Session(with_points(on_the_faces()), small_options(step=USED))
    session.run()
    kinds = [step.stage for step in session.trace.steps]
    fitted = kinds.index(StageKind.JUDGE)
    assert fitted > 0
    assert kinds[:fitted] == fitted * [StageKind.CLOSEST_POINTS], "the photos of these points are not known"
    verdict = session.trace.steps[fitted]
    assert not (verdict.reasons == StepReason.REJECTED_FIT).any()
    assert verdict.objective_after < verdict.objective_before
    assert np.array_equal(origin_of(session.sweep_state(fitted + 1)), session.trace.vertices_at(fitted + 1))
    assert not any(kind.is_fit for kind in kinds[fitted:])
    assert error_of(session.vertices) < 0.05 * error_of(session.trace.start)


def test_a_run_with_points_is_not_continued_with_others():
    """Its steps could not be computed again; those of a run without a pull to them could."""
    points = on_the_faces()
    scene = with_points(points)
    drawn, free = Session(scene, small_options(step=USED)), Session(scene, small_options())
    for session in (drawn, free):
        session.step()
        Session(scene, trace=session.trace)
    for other in (with_points(points[1:]), with_points(-points), corner_scene(FAR)):
        Session(other, trace=free.trace)
        with pytest.raises(InputError, match=r"the sparse points it was recorded with \(1200 of them\), found"):
            Session(other, trace=drawn.trace)


@pytest.mark.slow
def test_points_that_the_photos_contradict_are_not_used():
    wrong = on_the_faces() + np.array([0.08, -0.05, 0.06])
    with_wrong = Session(with_points(wrong, (0.01, 0, 0)), small_options(step=USED))
    without = Session(corner_scene((0.01, 0, 0)), small_options(step=USED))
    with_wrong.run()
    without.run()
    assert np.array_equal(with_wrong.vertices, without.vertices)


@pytest.mark.slow
def test_points_kept_for_evaluation_change_nothing():
    scene = with_points(on_the_faces())
    assert scene.sparse_points is not None
    positions = scene.sparse_points.positions.copy()
    positions[1::2] += 5.0
    results = []
    for points in (scene.sparse_points.positions, positions):
        session = Session(replace(scene, sparse_points=sparse_points(points)), small_options(step=USED))
        session.run()
        results.append(session.vertices)
    assert np.array_equal(*results)


def test_a_run_that_used_points_resumes_to_the_same_bytes(tmp_path):
    scene, options = with_points(on_the_faces()), small_options(step=USED)
    whole, begun = Session(scene, options), Session(scene, options)
    whole.run()
    begun.trace.attach(tmp_path / "run.trace")
    for _ in range(3):
        begun.step()
    begun.trace.detach()
    resumed = Session(scene, trace=Trace.load(tmp_path / "run.trace"))
    resumed.run()
    assert np.array_equal(resumed.vertices, whole.vertices)


def test_a_noisy_start_is_smoothed_before_it_is_fitted_to_the_points():
    scene = with_points(on_the_faces(), START)
    session = Session(scene, small_options(step={**USED, "smoothing": [0.1, 0.03, 0.01]}))
    plan = session.make_plan()
    assert plan.is_smoothed
    assert plan.is_fitted_to_points
    order = []
    while session.step() is not None and (kind := session.trace.steps[-1].stage) is not StageKind.PHOTOS:
        order += [kind] if order[-1:] != [kind] else []
    assert order == [StageKind.SMOOTHNESS, StageKind.JUDGE, StageKind.CLOSEST_POINTS, StageKind.JUDGE]
    moment = len(session.trace) - 1
    assert np.array_equal(origin_of(session.sweep_state(moment)), session.trace.vertices_at(moment))


def test_a_mesh_far_from_all_points_stays():
    scene = with_points(on_the_faces() + 10.0)
    found = closest_fit(problem_of(scene), scene.mesh.vertices, 3)
    assert np.array_equal(found.places, scene.mesh.vertices)
    assert not found.precision.any()


def test_a_run_with_points_far_from_the_mesh_does_without_them():
    session = Session(with_points(on_the_faces() + 10.0), small_options(step=USED))
    assert not session.make_plan().is_fitted_to_points


@pytest.mark.parametrize("seed", [4, 5, 6])
def test_false_points_do_not_keep_photos_from_correcting_the_start(seed: int):
    false = on_the_faces() + np.random.default_rng(seed).uniform(-0.2, 0.2, (600, 3))
    session = Session(observed(corner_scene(), false, is_shared=False), small_options(step=USED))
    session.run()
    assert error_of(session.vertices) < 0.1 * error_of(session.scene.mesh.vertices)


def test_the_fit_is_free_of_units():
    points = on_the_faces() + 0.01 * np.random.default_rng(5).standard_normal((600, 3))
    scene = with_points(points)
    expected = closest_fit(problem_of(scene), scene.mesh.vertices, 6).places
    mesh, far = Mesh(1000 * scene.mesh.vertices + 5e4, FACES), sparse_points(np.repeat(1000 * points + 5e4, 2, axis=0))
    large = replace(scene, mesh=mesh, sparse_points=far)
    found = closest_fit(problem_of(large), mesh.vertices, 6).places
    assert found == pytest.approx(1000 * expected + 5e4, abs=1e-5)


def test_fewer_points_than_coordinates_are_not_used():
    few, enough = (Session(with_points(on_the_faces(count)), small_options(step=USED)) for count in (18, 24))
    assert not few.make_plan().is_fitted_to_points
    assert enough.make_plan().is_fitted_to_points


def test_points_whose_photos_are_known_suffice_with_one_for_each_vertex():
    start = corner_scene(FAR)
    sparse = np.random.default_rng(2).permutation(on_the_faces(60))
    few, enough = (Session(observed(start, sparse[:n]), small_options(step=USED)) for n in (6, 7))
    assert len(start.mesh.vertices) == 7
    assert not few.make_plan().is_fitted_to_points
    assert few.make_plan().start_sigma == 0  # they do not measure the start either
    assert enough.make_plan().start_sigma > 0


def test_energies_of_sweeps_leave_out_what_was_done_to_the_start():
    session = Session(with_points(on_the_faces()), small_options(step=USED))
    session.run()
    report = run_report(session, "accurate", {}, {})
    assert [stage["kind"] for stage in report["stages"]][:3] == ["closest_points", "judge", "photos"]
    first = report["sweeps"][0]
    steps = [record for record in session.trace.steps if record.position[:2] == (first["level"], first["sweep"])]
    assert all(record.stage is StageKind.PHOTOS for record in steps)
    assert first["steps"] == len(steps)
    assert first["before"] == pytest.approx(steps[0].face_energy_before.sum())


@pytest.mark.parametrize("origin", ["given", "own"])
def test_observed_points_beside_the_mesh_do_not_pull_it(origin):
    start = corner_scene(FAR)
    rng = np.random.default_rng(5)
    beside = np.column_stack([rng.uniform(-0.4, 1.4, (400, 2)), rng.uniform(-0.25, -0.02, 400)])
    runs = []
    for points in (on_the_faces(300), np.concatenate([on_the_faces(300), beside])):
        session = Session(observed(start, points, origin), small_options(step=USED))
        session.make_plan()
        while session.next_stage is not StageKind.PHOTOS:
            session.step()
        runs.append(session)
    assert all(session.plan is not None and session.plan.is_fitted_to_points for session in runs)
    clean, cluttered = (session.vertices for session in runs)
    assert error_of(clean) < 0.5 * error_of(start.mesh.vertices)
    assert np.linalg.norm(clean - cluttered, axis=1).max() < 0.02


@pytest.mark.parametrize(
    ("displaced", "height", "is_fitted"), [(FAR, np.inf, True), (FAR, 0.0, False), ((0.0, 0.0, 0.0), np.inf, False)]
)
def test_a_fit_to_points_of_surface_sweeps_needs_little_photo_gain(
    displaced, height, is_fitted, monkeypatch: pytest.MonkeyPatch
):
    """No fit lowers the loss by 95 %. One without sweeps is then refused, and one from the truth, which lowers no loss, too."""
    monkeypatch.setattr("fairing.run.stepper.GAIN", 0.95)
    monkeypatch.setattr("fairing.run.fits.typical_footprint", lambda *_: height)
    scene = observed(corner_scene(displaced), on_the_faces(600))
    assert Session(scene, small_options(step=USED)).make_plan().is_fitted_to_points == is_fitted


def test_the_points_measure_how_far_off_the_start_is():
    options = PRESETS["accurate"].with_levels(smoothing=0.0)
    far, near = (corner_scene(at) for at in (tuple(1.3 * x for x in START), (0.0, 0.0, 0.0)))
    sigma_far, sigma_near = (
        Session(observed(scene, on_the_faces(600)), options).make_plan().start_sigma for scene in (far, near)
    )
    moved = max(
        np.linalg.norm(np.subtract(*camera.project(np.array([far.mesh.vertices[0], VERTICES[0]]))[0]))
        for camera in (view.camera for view in far.views)
    )
    assert 0.3 * moved < sigma_far < 1.5 * moved
    assert sigma_near == FINE_BLUR


def test_points_that_no_fit_used_prefer_the_state_they_lie_on():
    scene = observed(corner_scene(FAR), on_the_faces(600))
    problem, truth = problem_of(scene, small_options(step=USED)), corner_scene((0, 0, 0)).mesh.vertices
    assert held_out_points_prefer(problem, scene.mesh.vertices, truth, without=False)
    assert not held_out_points_prefer(problem, truth, scene.mesh.vertices, without=False)
    without = problem_of(scene, small_options(step={"points": [0.0]}))
    assert not held_out_points_prefer(without, scene.mesh.vertices, truth, without=False)


def test_points_accept_smoothing_of_noise_and_refuse_it_at_the_truth():
    exact, fine = observed(corner_scene((0, 0, 0)), on_the_faces(300)), subdivided(corner_scene((0, 0, 0)))
    assert not points_accept_smoothing(problem_of(exact))
    noise = np.random.default_rng(8).normal(0, 0.03, fine.mesh.vertices.shape)
    noisy = replace(fine, mesh=fine.mesh.moved(fine.mesh.vertices + noise))
    assert points_accept_smoothing(problem_of(observed(noisy, on_the_faces(900))))


def subdivided(scene: Scene) -> Scene:
    """The scene with each face cut into sixteen."""
    vertices, faces = scene.mesh.vertices, scene.mesh.faces
    for _ in range(2):
        vertices, faces = trimesh.remesh.subdivide(vertices, faces)
    return Scene.build(scene.name, vertices, faces, scene.views, points_choice="given")


def covered(side: int = 40) -> dict[int, np.ndarray]:
    """Photos of the corner with another pattern in front of another part of each."""
    rng = np.random.default_rng(6)
    result = {}
    for i, photo in enumerate(photos()):
        y, x = rng.integers(20, 100 - side), rng.integers(40, 120 - side)
        result[i] = photo.copy()
        result[i][y : y + side, x : x + side] = (
            np.repeat(rng.integers(0, 256, (side // 4, side // 4, 1)), 3, 2).repeat(4, axis=0).repeat(4, axis=1)
        )
    return result


def test_the_prior_to_the_start_grows_with_the_loss_and_falls_with_the_variance_of_the_start():
    sigma = 3.0
    for change in ({}, covered()):
        problem = problem_of(corner_scene(change=change))
        vertices = problem.start + 0.01 * np.random.default_rng(7).standard_normal(problem.start.shape)
        plain, held = (
            begin_sweep(problem, level, Photos(StageKind.PHOTOS, 1, 1), 0, vertices, problem.start)
            for level in (Level(1, 0.1), Level(1, 0.1, start_sigma=sigma, prior=0.5))
        )
        (to_start, smooth), (none, same) = held.terms, plain.terms
        assert np.array_equal(smooth.precision, same.precision)
        assert not none.precision.any(), "without a standard deviation the prior has no strength"
        assert np.array_equal(to_start.places, problem.start)
        losses = losses_around(problem, held, vertices)
        for found, loss, px_per_unit in zip(to_start.precision, losses, held.pixels_per_unit, strict=True):
            expected = 0.5 * RESIDUAL_AREA * loss * (px_per_unit / sigma) ** 2
            assert found == pytest.approx(expected * np.eye(3), rel=0.05, abs=1e-6 * expected)


def losses_around(problem: Problem, sweep: SweepState, vertices: np.ndarray) -> list[float]:
    """Mean loss per photo pixel of the faces around each vertex, face by face."""
    energy, result = problem.energies(sweep.context, vertices, sweep.scale).energy, []
    for v in range(len(vertices)):
        loss, pixels = 0.0, 0.0
        for f in np.flatnonzero((v == FACES).any(axis=1)):
            n, k = sweep.context.n_views[f], sweep.context.kernel.face_dimensions[f]
            loss += energy[f] * n / (n - k)
            pixels += sweep.context.footprint_area[f] * n
        result.append(loss / pixels)
    return result


def test_the_points_fade_at_vertices_around_which_photos_agree(monkeypatch):
    """Every point on a face shares the factors of its corners, by how much each moves it."""
    problem = problem_of(observed(corner_scene(change=covered()), on_the_faces(600)))
    level, photos_alone = Level(1, 0.1, attraction=0.3), Level(1, 0.1)
    stage = Photos(StageKind.PHOTOS, 1, 1)
    plain = begin_sweep(problem, photos_alone, stage, 0, VERTICES, problem.start)
    variance = np.array(losses_around(problem, plain, VERTICES)) * plain.sigma[0] ** 2
    full = 2 * float(np.median(variance))
    monkeypatch.setattr("fairing.run.sweep.POINTS_VARIANCE", full)
    points = begin_sweep(problem, level, stage, 0, VERTICES, problem.start).terms[-1]
    assert plain.system is not None
    typical = np.median(np.linalg.eigvalsh(vertex_systems(problem.scene.mesh, plain.system)[0])[:, 2])
    fitted = closest_points(
        problem.scene.mesh.moved(VERTICES),
        points_on_mesh(problem.scene, problem.observed_points, VERTICES, None),
        VERTICES,
    )
    average = np.einsum("vii->vi", fitted.hessians(VERTICES))
    assert variance.max() > 1.15 * variance.min(), "one factor for all vertices would not do"
    assert isinstance(points, Rows)
    assert points.residuals == pytest.approx(fitted.residuals)
    for found, ids, d in zip(points.information, fitted.ids, fitted.derivatives, strict=True):
        share, factors = np.linalg.norm(d, axis=1), np.minimum(1.0, variance[ids] / full)
        wanted = 0.3 * typical * (share @ factors) / share.sum() / average[average > 0].mean()
        assert found == pytest.approx(wanted, rel=0.05)


def test_the_prior_to_the_start_is_planned_where_points_measure_the_start():
    near, far = (corner_scene(tuple(factor * x for x in START)) for factor in (0.1, 1.3))
    options = PRESETS["accurate"].with_levels(smoothing=0.0)
    without = Session(near, options).make_plan()
    measured, reached = (Session(observed(scene, on_the_faces(600)), options).make_plan() for scene in (near, far))
    assert without.start_sigma == 0
    assert 1 <= measured.start_sigma < FAR_ERROR < reached.start_sigma


def test_a_start_near_its_points_begins_at_the_last_level():
    off_the_mesh = on_the_faces(600) + np.random.default_rng(3).choice([-0.06, 0.06], (600, 1))
    options = PRESETS["accurate"].with_levels(smoothing=0.0)
    near, moved = (corner_scene(tuple(factor * x for x in START)) for factor in (0.1, 1.3))
    last = options.n_levels - 1

    def first_level(scene: Scene, points: np.ndarray, options: FairingOptions = options) -> int:
        return Session(observed(scene, points), options).make_plan().first_level

    assert first_level(near, on_the_faces(600)) == first_level(moved, on_the_faces(600)) == last
    assert first_level(corner_scene(FAR), off_the_mesh) < last


def test_edges_are_sought_as_far_as_the_start_is_off_where_the_mesh_fits_the_points():
    off_the_mesh = on_the_faces(600) + np.random.default_rng(3).choice([-0.06, 0.06], (600, 1))
    options = PRESETS["accurate"].with_levels(smoothing=0.0)
    starts = (tuple(factor * x for x in START) for factor in (0.1, 1.3))
    near, far = (Session(observed(corner_scene(start), on_the_faces(600)), options).make_plan() for start in starts)
    coarse = Session(observed(corner_scene(FAR), off_the_mesh), options).make_plan()
    assert near.edge_reach == 2
    assert far.is_fitted_to_points
    assert far.edge_reach == far.start_sigma > 2
    assert coarse.is_fitted_to_points
    assert coarse.start_sigma > FAR_ERROR
    assert coarse.edge_reach == 2
    assert (near.represents_surface, far.represents_surface, coarse.represents_surface) == (True, True, False)


def test_a_good_start_is_kept_where_photos_show_other_things_in_front():
    scene = observed(corner_scene(tuple(0.2 * x for x in START), change=covered(24)), on_the_faces(600))
    ends = []
    for sigma in (0.0, 1.0):
        session = Session(scene, small_options(step={**USED, "prior": 0.0}))
        session.trace.plan = replace(session.make_plan(), start_sigma=sigma)
        session.run()
        before_the_last_step = session.trace.vertices_at(len(session.trace) - 1)
        ends.append(np.linalg.norm(before_the_last_step - VERTICES, axis=1).max())
    assert ends[0] > 1.2 * error_of(scene.mesh.vertices)
    assert ends[1] < error_of(scene.mesh.vertices)
