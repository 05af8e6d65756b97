"""The compiled loops against independent oracles: numpy, scipy, OpenCV and finite differences."""

import cv2
import numpy as np
import pytest
from numba import njit
from scipy.ndimage import map_coordinates

import fairing.solve.energy
from fairing.errors import Cancelled
from fairing.judge.inspect import face_cells
from fairing.kernels.eigenspace import fit_face
from fairing.kernels.normal_equations import normal_equations
from fairing.kernels.robust import HISTOGRAM_STEP, weigh
from fairing.kernels.rows import BLOCK
from fairing.run.session import SweepState
from fairing.solve.energy import Evaluator, robust_scale
from tests.blurred_photo import blurred
from tests.cell_cases import ALL_CORNERS, FACE_IDS, prepared, sample_points, sharp_options
from tests.numpy_twin import TwinPhotos, evaluate_face
from tests.small_scene import FACES, HEIGHT, WIDTH, corner_scene, photos, small_options


@pytest.mark.parametrize(("interpolation", "order"), [("bilinear", 1), ("cubic", 3)])
@pytest.mark.parametrize("warp", ["homography", "affine"])
def test_cells_are_the_photo_at_the_samples_positions(interpolation, order, warp):
    session, sweep = prepared(sharp_options(cells={"warp": warp, "interpolation": [interpolation]}))
    vertices = session.vertices
    for face in (0, 3):
        cells = face_cells(session, face)
        bary = sample_points(session, sweep, face)
        for view, observed in zip(cells.views, cells.observed, strict=True):
            camera = session.scene.views[view].camera
            corners = vertices[FACES[face]]
            if warp == "homography":
                uv, _ = camera.project(bary @ corners)
            else:
                photo_triangle = camera.project(corners)[0].astype(np.float32)
                unit = np.array([[1, 0], [0, 1], [0, 0]], np.float32)
                uv = cv2.transform(bary[None, :, :2], cv2.getAffineTransform(unit, photo_triangle))[0]
            expected = map_coordinates(blurred(view, 1.0), [uv[:, 1], uv[:, 0]], order=order, mode="mirror")
            # Places are exact to 1e-5 px in float32, OpenCV's affine to 3e-5; grey levels change by up to 60 a pixel.
            assert np.abs(observed - expected).max() < 0.02


@pytest.mark.parametrize("centered", [False, True])
def test_eigenspace_is_the_truncated_singular_value_decomposition(centered):
    session, _ = prepared(sharp_options(eigenspace={"centered": centered, "dimensions": [3]}))
    for face in range(6):
        cells = face_cells(session, face)
        observed = cells.observed.astype(np.float64)
        mean = observed.mean(axis=0) if centered else np.zeros(observed.shape[1])
        U, s, Vt = np.linalg.svd(observed - mean, full_matrices=False)
        expected = (U[:, :3] * s[:3]) @ Vt[:3] + mean
        assert np.abs(cells.singular_values[: len(s)] / s - 1)[:4].max() < 1e-3
        assert np.abs(cells.reconstruction - expected).max() < 0.05
        assert np.abs(np.abs(np.sum(cells.basis * Vt[:3], axis=1)) - 1).max() < 1e-3


def energy(sweep: SweepState, vertices: np.ndarray) -> float:
    return float(Evaluator(1).measure(sweep.context, vertices, FACE_IDS, sweep.scale).energy.sum())


@pytest.mark.parametrize("solver", ["alternating", "variable_projection"])
@pytest.mark.parametrize("warp", ["homography", "affine"])
@pytest.mark.parametrize("extra", [{}, {"eigenspace": {"centered": True}}, {"cells": {"remove_bias": True}}])
def test_gradient_is_the_slope_of_the_energy(solver, warp, extra):
    """For least squares the best eigenspace is the fitted one, so that the slope with U, c refitted is that with them
    held fixed (envelope theorem), and both solvers have the same gradient."""
    options = sharp_options(cells={"warp": warp, "interpolation": ["cubic"]} | extra.get("cells", {}))
    if "eigenspace" in extra:
        options = sharp_options(cells={"warp": warp, "interpolation": ["cubic"]}, eigenspace=extra["eigenspace"])
    session, sweep = prepared(options)
    vertices = session.vertices
    system = Evaluator(1).linearise(sweep.context, vertices, FACE_IDS, ALL_CORNERS, sweep.scale, solver)
    gradient = np.zeros((7, 3))
    for f in range(6):
        np.add.at(gradient, FACES[f], system.g[f].reshape(3, 3))
    step = 3e-4  # 0.02 px: rounding of the energy and third derivatives balance
    for vertex, axis in [(0, 0), (0, 1), (0, 2), (3, 2), (5, 0)]:
        ahead, behind = vertices.copy(), vertices.copy()
        ahead[vertex, axis] += step
        behind[vertex, axis] -= step
        slope = (energy(sweep, ahead) - energy(sweep, behind)) / (2 * step)
        # Found at most 1.3e-4.
        assert gradient[vertex, axis] == pytest.approx(slope, abs=5e-4 * np.abs(gradient).max())


@pytest.mark.parametrize("warp", ["homography", "affine"])
@pytest.mark.parametrize("solver", ["alternating", "variable_projection"])
def test_systems_of_one_corner_are_blocks_of_those_of_all(warp, solver):
    session, sweep = prepared(small_options(cells={"warp": warp}), masks=True)
    evaluator = Evaluator(1)
    whole = evaluator.linearise(sweep.context, session.vertices, FACE_IDS, ALL_CORNERS, sweep.scale, solver)
    for corner in range(3):
        block = slice(3 * corner, 3 * corner + 3)
        one = evaluator.linearise(sweep.context, session.vertices, FACE_IDS, np.full(6, corner), sweep.scale, solver)
        assert np.array_equal(one.energy, whole.energy)
        assert np.allclose(one.H[:, block, block], whole.H[:, block, block], rtol=1e-5, atol=1e-6 * whole.H.max())
        assert np.allclose(one.g[:, block], whole.g[:, block], rtol=1e-5, atol=1e-6 * np.abs(whole.g).max())
        outside = np.delete(one.H, np.arange(9)[block], axis=1)
        assert not outside.any()


@pytest.mark.parametrize("corner", [0, 1, 2])
def test_the_fused_kernel_agrees_with_its_numpy_twin(corner):
    session, sweep = prepared(small_options(eigenspace={"dimensions": [3]}))
    photos_of_twin = TwinPhotos.of(sweep.context.kernel)
    system = Evaluator(1).linearise(
        sweep.context, session.vertices, FACE_IDS, np.full(6, corner), sweep.scale, "variable_projection"
    )
    block = slice(3 * corner, 3 * corner + 3)
    for face in range(6):
        energy, H, g = evaluate_face(
            sweep.context.kernel, photos_of_twin, session.vertices, face, corner, sweep.scale[face]
        )
        # cv2.remap may round places to 1/32 px.
        assert system.energy[face] == pytest.approx(energy, rel=0.01)
        assert system.H[face, block, block] == pytest.approx(H, rel=0.01, abs=0.01 * H.max())
        assert system.g[face, block] == pytest.approx(g, rel=0.01, abs=0.01 * np.abs(g).max())


def test_normal_matrices_are_symmetric_and_positive():
    session, sweep = prepared(small_options(), masks=True)
    system = Evaluator(1).linearise(
        sweep.context, session.vertices, FACE_IDS, ALL_CORNERS, sweep.scale, "variable_projection"
    )
    assert np.array_equal(system.H, system.H.transpose(0, 2, 1))
    assert np.linalg.eigvalsh(system.H).min() > -1e-6 * system.H.max()


@pytest.mark.parametrize("components", [3, 9])
@pytest.mark.parametrize("corner", [-1, 1])
@pytest.mark.parametrize(("n", "k"), [(3, 1), (6, 2), (7, 3), (8, 4)])
def test_normal_equations_are_the_sums_over_views_and_samples(components, corner, n, k):
    """Derivatives of several blocks of samples, with whole and broken groups of three views and three dimensions."""
    rng, p = np.random.default_rng(7), 2 * BLOCK + 40
    axes = components if corner < 0 else 3
    G = rng.normal(size=(axes, n, p)).astype(np.float32)
    hats = rng.dirichlet(np.ones(3), p).T.astype(np.float32)
    basis, V = np.linalg.qr(rng.normal(size=(p, k)))[0].T.astype(np.float32), np.linalg.qr(rng.normal(size=(n, k)))[0]
    residual, weights = rng.normal(size=(2, n, p)).astype(np.float32) ** 2
    pair_weight = rng.uniform(1, 2, n)
    derivatives = np.zeros((9, n, p))
    for a in range(9) if corner < 0 else range(3 * corner, 3 * corner + 3):
        D = G[a if len(G) == 9 else a % 3].astype(float)
        D = hats[a // 3] * (D - V @ (V.T @ D))
        derivatives[a] = D - (D @ basis.T) @ basis
    expected_H = np.einsum("i,aip,ip,bip->ab", pair_weight, derivatives, weights, derivatives, optimize=True)
    expected_g = np.einsum("i,aip,ip,ip->a", pair_weight, derivatives, weights, residual, optimize=True)
    H, g = np.zeros((9, 9)), np.zeros(9)
    equations_of(G, hats, corner, basis, V, residual, weights, pair_weight, H, g)
    assert pytest.approx(expected_H, abs=1e-5 * expected_H.max()) == H
    assert pytest.approx(expected_g, abs=1e-4 * np.abs(expected_g).max()) == g


@pytest.mark.parametrize(("n", "k"), [(3, 1), (7, 3), (8, 5)])
def test_the_eigenspace_of_several_blocks_is_the_singular_value_decomposition(n, k):
    rng, p = np.random.default_rng(3), 2 * BLOCK + 40
    cells = (rng.normal(size=(n, n)) * 3.0 ** -np.arange(n) @ rng.normal(size=(n, p))).astype(np.float32)
    U, s, Vt = np.linalg.svd(cells.astype(float), full_matrices=False)
    basis, V, found, residual = (np.empty((k + 1, p), np.float32), np.empty((n, k)), np.empty(n), np.empty_like(cells))
    fitted(cells, k, np.zeros((1, 1), np.float32), basis, V, found, residual)
    assert found[:k] == pytest.approx(s[:k], rel=1e-4)
    assert np.abs((V * U[:, :k]).sum(axis=0)) == pytest.approx(np.ones(k), abs=1e-5)
    assert np.abs((basis[:k] * Vt[:k]).sum(axis=1)) == pytest.approx(np.ones(k), abs=1e-5)
    assert np.abs(residual - (cells - (U[:, :k] * s[:k]) @ Vt[:k])).max() < 1e-4 * np.abs(cells).max()


# Kernels cannot be called from Python, see `fairing.util.compiled_only`.
@njit
def equations_of(G, hats, corner, basis, V, residual, weights, pair_weight, H, g):
    normal_equations(G, hats, corner, basis, V, residual, weights, pair_weight, H, g)


@njit
def weighed(residual, norm, squared_scale, weights):
    return weigh(residual, norm, squared_scale, weights)


@njit
def fitted(cells, k, mask_weight, basis, V, singular_values, residual):
    fit_face(cells, k, False, mask_weight, False, basis, V, singular_values, residual)


@pytest.mark.parametrize("norm", ["geman_mcclure", "geman_mcclure_printed", "huber", "least_squares"])
def test_weight_times_residual_is_the_slope_of_the_norm(norm):
    code = {"geman_mcclure": 0, "geman_mcclure_printed": 0, "huber": 1, "least_squares": 2}[norm]
    sigma = 7.0
    scale = robust_scale(small_options(robust={"norm": norm}).robust, np.array([sigma]))[0]
    weight = np.zeros(1, np.float32)

    def rho(e: float) -> float:
        return weighed(np.array([e], np.float32), code, scale, weight)

    expected = {
        "geman_mcclure": lambda e: e**2 / (sigma**2 + e**2),
        "geman_mcclure_printed": lambda e: e**2 / (sigma + e**2),
        "huber": lambda e: e**2 / sigma**2 if abs(e) <= sigma else (2 * abs(e) * sigma - sigma**2) / sigma**2,
        "least_squares": lambda e: e**2 / sigma**2,
    }[norm]
    for e in (-40.0, -6.5, -0.3, 0.0, 0.8, 3.0, 7.5, 90.0):
        assert rho(e) == pytest.approx(expected(e), rel=1e-5, abs=1e-7)
        slope = (expected(e + 1e-4) - expected(e - 1e-4)) / 2e-4
        rho(e)
        assert weight[0] * e == pytest.approx(slope, rel=1e-4, abs=1e-6)


def test_geman_mcclure_turns_at_sigma_over_root_three_and_the_printed_form_does_not():
    e = np.linspace(0.01, 30, 3000, dtype=np.float32)
    for norm, turn in (("geman_mcclure", 9 / np.sqrt(3)), ("geman_mcclure_printed", np.sqrt(9 / 3))):
        scale = robust_scale(small_options(robust={"norm": norm}).robust, np.array([9.0]))[0]
        weight = np.zeros_like(e)
        weighed(e, 0, scale, weight)
        assert e[np.argmax(weight * e)] == pytest.approx(turn, abs=0.02)


def test_masked_samples_have_no_influence():
    """A disc of one photo is painted over; samples within three pixels of it are masked in both."""
    options = sharp_options(schedule={"blur": [0.0]})
    _, probe = prepared(options)
    view = 2
    center = corner_scene().views[view].camera.project(np.array([0.5, 0.55, 1.0]))[0]
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    painted = photos()[view].copy()
    painted[(x - center[0]) ** 2 + (y - center[1]) ** 2 < 6**2] = 255
    results = []
    for change in ({}, {view: painted}):
        session, sweep = prepared(options, change=change)
        data = sweep.context.kernel
        masks, at = [], 0
        for face in range(6):
            bary = sample_points(session, sweep, face)
            for pair in range(data.pair_start[face], data.pair_start[face + 1]):
                uv, _ = session.scene.views[data.pair_view[pair]].camera.project(bary @ session.vertices[FACES[face]])
                far = np.linalg.norm(uv - center, axis=1) > 9
                masks.append((far | (data.pair_view[pair] != view)).astype(np.uint8))
                data.pair_mask[pair] = at
                at += len(far)
        data = data._replace(masks=np.concatenate(masks))
        assert not data.masks.all()
        object.__setattr__(sweep.context, "kernel", data)
        evaluator = Evaluator(1)
        system = evaluator.linearise(
            sweep.context, session.vertices, FACE_IDS, ALL_CORNERS, probe.scale, "variable_projection"
        )
        results.append(system)
    assert np.array_equal(results[0].energy, results[1].energy)
    assert np.array_equal(results[0].H, results[1].H)
    assert np.array_equal(results[0].g, results[1].g)


def test_an_offset_of_one_photo_changes_nothing_where_means_are_removed():
    options = sharp_options(cells={"remove_bias": True})
    soft = {view: photo // 2 + 60 for view, photo in enumerate(photos())}
    _, before = prepared(options, change=soft)
    session, after = prepared(options, change=soft | {3: soft[3] + 25})
    one, other = (Evaluator(1).measure(s.context, session.vertices, FACE_IDS, before.scale) for s in (before, after))
    assert np.allclose(one.energy, other.energy, rtol=1e-4)


def test_gains_of_photos_leave_a_perfect_fit_perfect():
    """Cells that differ by factors only lie in a space of one dimension."""
    rng = np.random.default_rng(0)
    factors = rng.uniform(0.6, 1.2, 8)
    n, p = 8, 300
    texture = rng.uniform(0, 200, p).astype(np.float32)
    cells = (factors[:, None] * texture).astype(np.float32)
    residual = np.empty_like(cells)
    nothing = np.zeros((1, 1), np.float32)
    fitted(cells, 1, nothing, np.empty((2, p), np.float32), np.zeros((n, 2)), np.empty(n), residual)
    assert np.abs(residual).max() < 1e-3


def test_a_corner_behind_a_camera_makes_the_energy_infinite_and_nothing_else():
    session, sweep = prepared(small_options())
    vertices = session.vertices
    vertices[0] = session.scene.views[0].camera.center + np.array([0.5, 0.5, 0.5])
    found = Evaluator(1).measure(sweep.context, vertices, FACE_IDS, sweep.scale)
    assert np.isinf(found.energy).all()


def test_threads_do_not_change_a_bit():
    session, sweep = prepared(small_options(), masks=True)
    one, two = (
        Evaluator(threads).linearise(
            sweep.context, session.vertices, FACE_IDS, ALL_CORNERS, sweep.scale, "variable_projection"
        )
        for threads in (1, 2)
    )
    for name in ("energy", "pair_energy", "H", "g"):
        assert np.array_equal(getattr(one, name), getattr(two, name)), name


def test_a_long_list_is_computed_in_parts_and_can_be_cancelled(monkeypatch: pytest.MonkeyPatch):
    session, sweep = prepared(small_options(), masks=True)
    whole = Evaluator(1).measure(sweep.context, session.vertices, FACE_IDS, sweep.scale)
    monkeypatch.setattr(fairing.solve.energy, "MAX_PART_SAMPLES", 1)
    checks = []
    in_parts = Evaluator(1, lambda: checks.append(1)).measure(sweep.context, session.vertices, FACE_IDS, sweep.scale)
    assert len(checks) == len(FACE_IDS)
    assert np.array_equal(in_parts.energy, whole.energy)
    assert np.array_equal(in_parts.median, whole.median)

    def raise_if_cancelled() -> None:
        checks.append(1)
        if len(checks) == len(FACE_IDS) + 2:
            raise Cancelled

    with pytest.raises(Cancelled):
        Evaluator(1, raise_if_cancelled).measure(sweep.context, session.vertices, FACE_IDS, sweep.scale)


def test_statistics_are_the_largest_and_the_median_residual():
    session, sweep = prepared(small_options(), masks=True)
    found = Evaluator(1).measure(sweep.context, session.vertices, FACE_IDS, sweep.scale)
    for face in range(6):
        cells = face_cells(session, face)
        size = np.abs(cells.residual[cells.counts])
        assert found.largest[face] == pytest.approx(size.max())
        assert found.median[face] == pytest.approx(np.median(size), abs=HISTOGRAM_STEP)


def test_a_dimension_that_only_fits_noise_is_dropped():
    session, sweep = prepared(small_options(eigenspace={"dimensions": [2], "significance": [0.0]}), masks=True)
    found = Evaluator(1).measure(sweep.context, session.vertices, FACE_IDS, sweep.scale)
    squared = [face_cells(session, face).singular_values ** 2 for face in range(6)]
    expected = np.array([values[1] / values[2:].mean() for values in squared])
    assert np.allclose(found.singular_value_ratio, expected, rtol=1e-4)
    least = float(np.median(expected))
    k = sweep.context.with_reduced_dimensions(found.singular_value_ratio, least).kernel.face_dimensions
    assert np.array_equal(k[FACE_IDS], np.where(expected < least, 1, 2))
