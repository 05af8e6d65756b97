"""The compiled loops against independent oracles: the paper's equations in NumPy, SciPy, OpenCV and finite differences."""

import numpy as np
import pytest
from numba import njit
from scipy.ndimage import map_coordinates

import fairing.solve.energy
from fairing import paper
from fairing.camera import Camera
from fairing.errors import Cancelled
from fairing.judge.inspect import face_cells
from fairing.kernels.eigenspace import GRAM_BLOCK, fit_face
from fairing.kernels.faces import evaluate_faces
from fairing.kernels.normal_equations import normal_equations
from fairing.kernels.robust import HISTOGRAM_STEP, weigh
from fairing.kernels.rows import BLOCK
from fairing.norms.built_in import norm_of
from fairing.run.session import SweepState
from fairing.solve.energy import Evaluator
from tests.blurred_photo import blurred
from tests.cell_cases import ALL_CORNERS, FACE_IDS, prepared, sample_points, sharp_options
from tests.rounding import EigenspaceTolerance, FaceTolerance, SystemTolerance, few, of_sum
from tests.small_scene import FACES, HEIGHT, WIDTH, corner_scene, photos, small_options

pytestmark = pytest.mark.compiled


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
            pixels, depths = camera.project(vertices[FACES[face]])
            weights = bary * depths if warp == "homography" else bary
            uv = weights @ pixels / weights.sum(axis=1, keepdims=True)
            expected = map_coordinates(blurred(view, 1.0), [uv[:, 1], uv[:, 0]], order=order, mode="mirror")
            # Places within a cell of at most 64 px take eight operations, and grey levels change by up to 60 a pixel; blur and
            # interpolation take at most forty of grey levels.
            assert np.abs(observed - expected).max() < 60 * few(8) * 64 + few(40) * 255


@pytest.mark.parametrize("centered", [False, True])
def test_eigenspace_is_the_truncated_singular_value_decomposition(centered):
    session, _ = prepared(sharp_options(eigenspace={"centered": centered, "dimensions": [3]}))
    for face in range(6):
        cells = face_cells(session, face)
        observed = cells.observed.astype(np.float64)
        mean = observed.mean(axis=0) if centered else np.zeros(observed.shape[1])
        U, s, Vt = np.linalg.svd(observed - mean, full_matrices=False)
        expected = (U[:, :3] * s[:3]) @ Vt[:3] + mean
        allowed = EigenspaceTolerance.of(observed - mean, 3, GRAM_BLOCK)
        # Subtracting the mean rounds n + 1 times, at the size of the cells.
        centring = few(len(observed) + 1) * np.abs(observed).max() if centered else 0.0
        grown = centring * np.sqrt(observed.size)  # largest change of a singular value (Weyl)
        assert (np.abs(cells.singular_values[:3] - s[:3]) <= allowed.values + grown).all()
        assert (np.abs(np.abs(np.sum(cells.basis * Vt[:3], axis=1)) - 1) <= allowed.basis + grown / s[:3]).all()
        assert (np.abs(cells.reconstruction - expected) <= allowed.residual + 2 * centring).all()


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
    step = 6e-4  # 0.03 px

    # An energy is the sum of cells' energies, each a sum over samples in float32.
    found = Evaluator(1).measure(sweep.context, vertices, FACE_IDS, sweep.scale)
    rounding = of_sum(BLOCK) * np.sqrt((found.pair_energy**2).sum())
    for vertex, axis in [(0, 0), (0, 1), (0, 2), (3, 2), (5, 0)]:

        def slope(step: float, vertex: int = vertex, axis: int = axis) -> float:
            ahead, behind = vertices.copy(), vertices.copy()
            ahead[vertex, axis] += step
            behind[vertex, axis] -= step
            return (energy(sweep, ahead) - energy(sweep, behind)) / (2 * step)

        # A central difference over twice the step errs four times as much.
        truncation = np.abs(slope(2 * step) - slope(step))
        assert gradient[vertex, axis] == pytest.approx(slope(step), abs=rounding / step + truncation)


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
        # Twice the same sums, of at most BLOCK terms. By Cauchy and Schwarz the sizes add up to at most the root of both
        # diagonal entries, or of one and twice the energy.
        diagonal = np.diagonal(whole.H, axis1=1, axis2=2)[:, block]
        sizes_H = np.sqrt(diagonal[:, :, None] * diagonal[:, None])
        sizes_g = np.sqrt(diagonal * 2 * whole.energy[:, None])
        assert (np.abs(one.H[:, block, block] - whole.H[:, block, block]) <= 2 * of_sum(BLOCK) * sizes_H).all()
        assert (np.abs(one.g[:, block] - whole.g[:, block]) <= 2 * of_sum(BLOCK) * sizes_g).all()
        outside = np.delete(one.H, np.arange(9)[block], axis=1)
        assert not outside.any()


PLACE = few(8) * 64
"""Largest error of a sample's place, px: eight operations within a cell of at most 64 px."""


def cell_of_the_paper(
    photo: np.ndarray, camera: Camera, triangle: np.ndarray, warp: str
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """A face's cell (p,) and its derivatives (3, p, 3) by the corners; then the largest changes of both within `PLACE`.

    The paper has the affine warp. Through a homography each point of the face is seen at its own projection, and it moves as a
    corner does, times its barycentric coordinate.
    """
    hats = paper.cell_pixels()
    if warp == "affine":
        cell = paper.warp_to_cell(photo, camera, triangle)
        pixels = hats @ camera.project(triangle)[0]
        image, slopes = cell.image, paper.interpolate(photo, pixels)[1]
        at_corners = np.array([paper.pixel_displacement(camera, corner) for corner in triangle])
        J = hats.T[..., None, None] * at_corners[:, None]
        derivatives = np.array([paper.residual_derivative(cell, camera, triangle[c], c) for c in range(3)])
    else:
        points = hats @ triangle
        pixels = camera.project(points)[0]
        image, slopes = paper.interpolate(photo, pixels)
        J = hats.T[..., None, None] * np.array([paper.pixel_displacement(camera, point) for point in points])
        derivatives = np.einsum("pa,cpak->cpk", slopes, J)
    offsets = PLACE * np.array([(1, 1), (1, -1), (-1, 1), (-1, -1)])
    nearby = [paper.interpolate(photo, pixels + offset)[1] for offset in offsets]
    turned = np.abs(np.array(nearby) - slopes).max(axis=0)  # slopes jump between pixels
    return image, derivatives, PLACE * np.abs(slopes).sum(axis=1), np.einsum("pa,cpak->cpk", turned, np.abs(J))


@pytest.mark.parametrize("warp", ["homography", "affine"])
def test_a_face_has_the_energy_and_the_normal_equations_of_the_paper(warp, monkeypatch: pytest.MonkeyPatch):
    """With U and c held fixed, and with what they would explain projected out of the derivatives (variable projection)."""
    size, k = 32, 3
    monkeypatch.setattr(paper, "CELL_SIZE", size)
    monkeypatch.setattr(paper, "DIMENSIONS", k)
    cells = {"warp": warp, "adaptive": False, "size": [size], "inset": [0.0], "interpolation": ["bilinear"]}
    session, sweep = prepared(small_options(eigenspace={"dimensions": [k]}, cells=cells))
    data, vertices = sweep.context.kernel, session.vertices
    cases = [(solver, corner) for solver in ("alternating", "variable_projection") for corner in range(3)]
    systems = [
        Evaluator(1).linearise(sweep.context, vertices, FACE_IDS, np.full(6, corner), sweep.scale, solver)
        for solver, corner in cases
    ]
    for face in range(6):
        pairs, sigma = slice(*data.pair_start[face : face + 2]), float(np.sqrt(sweep.scale[face]))
        weights, found = data.pair_weight[pairs], []
        for view, base in zip(data.pair_view[pairs], data.pair_base[pairs], strict=True):
            photo = data.pixels[base : base + HEIGHT * WIDTH].reshape(HEIGHT, WIDTH)
            camera = session.scene.views[view].camera
            found.append(cell_of_the_paper(photo, camera, vertices[FACES[face]], warp))
        images, derivatives, images_moved, derivatives_moved = (np.array(parts) for parts in zip(*found, strict=True))
        e = paper.residual(images)
        W, _, Z = np.linalg.svd(images, full_matrices=False)
        energy = weights @ paper.rho(e, sigma).sum(axis=1)
        for (solver, corner), system in zip(cases, systems, strict=True):
            de, projects = derivatives[:, corner], solver == "variable_projection"
            if projects:
                de = de - np.einsum("ik,jk,jpa->ipa", W[:, :k], W[:, :k], de, optimize=True)
                de = de - np.einsum("kp,kq,iqa->ipa", Z[:k], Z[:k], de, optimize=True)
            by_view = [paper.gauss_newton(e[[i]], de[[i]], sigma) for i in range(len(e))]
            H = sum(weight * H_view for weight, (H_view, _) in zip(weights, by_view, strict=True))
            g = sum(weight * g_view for weight, (_, g_view) in zip(weights, by_view, strict=True))
            hat_G, hat_G_moved = (np.moveaxis(x[:, corner], -1, 0) for x in (derivatives, derivatives_moved))
            allowed = FaceTolerance.of(
                images, images_moved, hat_G, hat_G_moved, k, projects, weights, sigma, BLOCK, GRAM_BLOCK
            )
            block, case = slice(3 * corner, 3 * corner + 3), (face, solver, corner)
            # Terms of g cancel, so that its tolerance can exceed 1 % of it.
            assert abs(system.energy[face] - energy) <= min(allowed.energy, 0.01 * energy), case
            assert (np.abs(system.H[face, block, block] - H) <= np.minimum(allowed.H, 0.01 * H.max())).all(), case
            assert (np.abs(system.g[face, block] - g) <= np.minimum(allowed.g, 0.01 * np.abs(g).max())).all(), case


def test_normal_matrices_are_symmetric_and_positive():
    session, sweep = prepared(small_options(), masks=True)
    system = Evaluator(1).linearise(
        sweep.context, session.vertices, FACE_IDS, ALL_CORNERS, sweep.scale, "variable_projection"
    )
    assert np.array_equal(system.H, system.H.transpose(0, 2, 1))
    # An entry errs by at most `of_sum` of the root of its diagonal entries, so all nine by nine by that of the trace.
    lowest, trace = np.linalg.eigvalsh(system.H)[:, 0], np.trace(system.H, axis1=1, axis2=2)
    assert (lowest >= -of_sum(BLOCK) * trace).all()


@pytest.mark.parametrize("components", [3, 9])
@pytest.mark.parametrize("corner", [-1, 1])
@pytest.mark.parametrize(("n", "k"), [(3, 1), (6, 2), (7, 3), (8, 4)])
def test_normal_equations_are_the_sums_over_views_and_samples(components, corner, n, k):
    """Derivatives of several blocks of samples, with whole and broken groups of three views and three dimensions."""
    rng, p = np.random.default_rng(7), 2 * BLOCK + 40
    axes = components if corner < 0 else 3
    G = rng.normal(size=(axes, n, p)).astype(np.float32)
    # In the engine's order and strides, whatever k: others are compiled anew.
    hats = np.ascontiguousarray(rng.dirichlet(np.ones(3), p).T, dtype=np.float32)
    basis = np.ascontiguousarray(np.linalg.qr(rng.normal(size=(p, k)))[0].T, dtype=np.float32)
    V = np.linalg.qr(rng.normal(size=(n, k + 1)))[0][:, :k]
    residual, weights = rng.normal(size=(2, n, p)).astype(np.float32) ** 2
    pair_weight = rng.uniform(1, 2, n)
    moving = range(9) if corner < 0 else range(3 * corner, 3 * corner + 3)
    hat_G, derivatives = np.zeros((2, 9, n, p))
    for a in moving:
        hat_G[a] = hats[a // 3].astype(float) * G[a if len(G) == 9 else a % 3]
        D = hat_G[a] - V @ (V.T @ hat_G[a])
        derivatives[a] = D - (D @ basis.T) @ basis
    all_weights = pair_weight[:, None] * weights
    expected_H = np.einsum("aip,ip,bip->ab", derivatives, all_weights, derivatives, optimize=True)
    expected_g = np.einsum("aip,ip,ip->a", derivatives, all_weights, residual, optimize=True)
    H, g = np.zeros((9, 9)), np.zeros(9)
    allowed = SystemTolerance.of(hat_G, V, basis.astype(float), derivatives, residual, all_weights, BLOCK)
    equations_of(G, hats, corner, basis, V, residual, weights, pair_weight, H, g)
    assert (np.abs(H - expected_H) <= allowed.H).all(), np.nanmax(np.abs(H - expected_H) / allowed.H)
    assert (np.abs(g - expected_g) <= allowed.g).all(), np.nanmax(np.abs(g - expected_g) / allowed.g)


@pytest.mark.parametrize(("n", "k"), [(3, 1), (7, 3), (8, 5)])
def test_the_eigenspace_of_several_blocks_is_the_singular_value_decomposition(n, k):
    rng, p = np.random.default_rng(3), 2 * BLOCK + 40
    cells = (rng.normal(size=(n, n)) * 3.0 ** -np.arange(n) @ rng.normal(size=(n, p))).astype(np.float32)
    U, s, Vt = np.linalg.svd(cells.astype(float), full_matrices=False)
    basis, V, found, residual = (np.empty((k + 1, p), np.float32), np.empty((n, k)), np.empty(n), np.empty_like(cells))
    fitted(cells, k, np.zeros((1, 1), np.float32), basis, V, found, residual)
    allowed = EigenspaceTolerance.of(cells.astype(float), k, GRAM_BLOCK)
    assert (np.abs(found[:k] - s[:k]) <= allowed.values).all()
    assert (np.abs(np.abs((V * U[:, :k]).sum(axis=0)) - 1) <= allowed.cosines).all()
    assert (np.abs(np.abs((basis[:k] * Vt[:k]).sum(axis=1)) - 1) <= allowed.basis).all()
    assert (np.abs(residual - (cells - (U[:, :k] * s[:k]) @ Vt[:k])) <= allowed.residual).all()


# Kernels cannot be called from Python, see `fairing.util.compiled_only`.
@njit
def equations_of(G, hats, corner, basis, V, residual, weights, pair_weight, H, g):
    normal_equations(G, hats, corner, basis, V, residual, weights, pair_weight, H, g)


@njit
def weighed(residual, norm, table, squared_scale, weights):
    return weigh(residual, norm, table, squared_scale, weights)


@njit
def fitted(cells, k, mask_weight, basis, V, singular_values, residual):
    fit_face(cells, k, False, mask_weight, False, basis, V, singular_values, residual)


@pytest.mark.parametrize("norm", ["geman_mcclure", "geman_mcclure_printed", "huber", "least_squares"])
def test_weight_times_residual_is_the_slope_of_the_norm(norm):
    chosen = norm_of(norm)
    sigma = 7.0
    scale = chosen.squared_scale(np.array([sigma]))[0]
    weight = np.zeros(1, np.float32)

    def rho(e: float) -> float:
        return weighed(np.array([e], np.float32), chosen.kernel, chosen.table, scale, weight)

    expected = {
        "geman_mcclure": lambda e: paper.rho(e, sigma),
        "geman_mcclure_printed": lambda e: e**2 / (sigma + e**2),
        "huber": lambda e: e**2 / sigma**2 if abs(e) <= sigma else (2 * abs(e) * sigma - sigma**2) / sigma**2,
        "least_squares": lambda e: e**2 / sigma**2,
    }[norm]
    for e in (-40.0, -6.5, -0.3, 0.0, 0.8, 3.0, 7.5, 90.0):
        # At most ten operations: the residual is rounded twice into its square, the norm takes up to six.
        assert rho(e) == pytest.approx(expected(e), rel=few(10), abs=0)
        step = 1e-4  # the difference errs by its square times the third derivative, which is below 1 / sigma^3 or, printed, 1
        slope = (expected(e + step) - expected(e - step)) / (2 * step)
        assert weight[0] * e == pytest.approx(slope, rel=few(10), abs=step**2)
        if norm == "geman_mcclure":
            assert weight[0] == pytest.approx(paper.secant(e, sigma), rel=few(10), abs=0)


def test_geman_mcclure_turns_at_sigma_over_root_three_and_the_printed_form_does_not():
    e = np.linspace(0.01, 30, 3000, dtype=np.float32)
    for norm, turn in (("geman_mcclure", 9 / np.sqrt(3)), ("geman_mcclure_printed", np.sqrt(9 / 3))):
        chosen = norm_of(norm)
        scale = chosen.squared_scale(np.array([9.0]))[0]
        weight = np.zeros_like(e)
        weighed(e, chosen.kernel, chosen.table, scale, weight)
        # Steps of 0.01, and near its largest value the influence is flat: it changes by its rounding within 0.005.
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


def test_vertices_that_are_read_only_compile_nothing_again():
    session, sweep = prepared(sharp_options())
    before = Evaluator(1).energies(sweep.context, session.vertices, FACE_IDS, sweep.scale).energy
    signatures, start = evaluate_faces.signatures, session.scene.mesh.vertices  # pyright: ignore
    assert not start.flags.writeable
    assert np.array_equal(Evaluator(1).energies(sweep.context, start, FACE_IDS, sweep.scale).energy, before)
    assert evaluate_faces.signatures == signatures  # pyright: ignore


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
    allowed = EigenspaceTolerance.of(cells.astype(float), 1, GRAM_BLOCK).residual + few(1) * cells
    assert (np.abs(residual) <= allowed).all()


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
