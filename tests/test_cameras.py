"""Bundle adjustment of cameras: derivatives, a small problem against SciPy, frame, deviations and the judge."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from fairing.camera import Camera
from fairing.cameras.adjustment import Deviations, adjust, objective, reduced_system, residual_lengths, triangulate
from fairing.cameras.estimation import estimate_poses, loss_at
from fairing.cameras.judge import is_held_out, judge_cameras
from fairing.cameras.lens_trial import lens_note
from fairing.cameras.misfits import find_misfits, resected
from fairing.cameras.observed_points import ObservedPoints
from fairing.cameras.pose_model import PARAMETERS, PoseModel, left_jacobians
from fairing.lens import Lens
from fairing.optimize.loss import GemanMcClure, Huber
from tests.square_loss import Square

WIDTH, HEIGHT, FOCAL = 800, 600, 900.0
SIGMA = Deviations(0.3, 0.8, 0.5)
SIGMA_LENS = replace(SIGMA, lens=0.7)


def ring(count: int = 7) -> list[Camera]:
    """Cameras on an arc around the origin, 6 to 7 units away, at two heights."""
    result = []
    for i in range(count):
        turn = -0.7 + 1.4 * i / (count - 1)
        eye = np.array([(6 + 0.2 * i) * np.sin(turn), (-1) ** i * 0.8, -(6 + 0.2 * i) * np.cos(turn)])
        z = -eye / np.linalg.norm(eye)
        x = np.cross([0, 1, 0], z) / np.linalg.norm(np.cross([0, 1, 0], z))
        R = np.stack([x, np.cross(z, x), z])
        K = np.array([[FOCAL, 0.4, 399.2], [0, FOCAL * 1.01, 301.7], [0, 0, 1]])
        result.append(Camera.from_krt(K, R, -R @ eye, WIDTH, HEIGHT))
    return result


def observed_by(
    cameras: list[Camera], n: int, noise: float, rng: np.random.Generator, outliers: float = 0
) -> ObservedPoints:
    """Points in a box around the origin, each seen by four to all cameras, with noise in px."""
    points = rng.uniform([-1.5, -1, -1], [1.5, 1, 1], (n, 3))
    seen = [np.sort(rng.permutation(len(cameras))[: rng.integers(4, len(cameras) + 1)]) for _ in range(n)]
    point, photo = np.repeat(np.arange(n), [len(s) for s in seen]), np.concatenate(seen)
    pixels = np.array([cameras[v].project(points[p])[0] for p, v in zip(point, photo, strict=True)])
    pixels += noise * rng.normal(size=pixels.shape)
    wrong = rng.uniform(size=len(pixels)) < outliers
    pixels[wrong] += rng.uniform(-40, 40, (wrong.sum(), 2))
    return ObservedPoints(points + 0.01 * rng.normal(size=points.shape), point, photo, pixels)


def turned(cameras: list[Camera], px: float, rng: np.random.Generator, shift: float = 0) -> list[Camera]:
    """Cameras turned at random about their own axes, px standard deviation an axis, and shifted, world units."""
    result = []
    for camera in cameras:
        R = Rotation.from_rotvec(rng.normal(size=3) * px / FOCAL).as_matrix() @ camera.camera_from_world[:, :3]
        result.append(Camera.from_krt(camera.K, R, -R @ (camera.center + shift * rng.normal(size=3)), WIDTH, HEIGHT))
    return result


def rotation_errors(cameras: list[Camera], true: list[Camera]) -> np.ndarray:
    """(v,) px at the focal length."""
    turns = [a.camera_from_world[:, :3] @ b.camera_from_world[:, :3].T for a, b in zip(cameras, true, strict=True)]
    return FOCAL * np.linalg.norm(Rotation.from_matrix(np.array(turns)).as_rotvec(), axis=1)


def turns_to(cameras: list[Camera], given: list[Camera], model: PoseModel) -> np.ndarray:
    """(v, 6) float, px: the parameters at which the given cameras are turned like others."""
    poses = np.zeros((len(model), PARAMETERS))
    for v, (a, b) in enumerate(zip(given, cameras, strict=True)):
        turn = b.camera_from_world[:, :3] @ a.camera_from_world[:, :3].T
        poses[v, :3] = Rotation.from_matrix(turn).as_rotvec() / model.angle_unit[v]
    return poses


def small_problem(
    n: int = 12, wrong: float = 2.0, adjusts_lens: bool = False
) -> tuple[PoseModel, np.ndarray, ObservedPoints]:
    """Four photos, the first two of one camera; the parameters share its intrinsics."""
    rng = np.random.default_rng(3)
    cameras = ring(4)
    observed = observed_by(cameras, n, 0.3, rng, outliers=0.05)
    given = turned(cameras, wrong, rng)
    given[2:] = [with_intrinsics(camera, 4.0, 0.5, -0.3) for camera in given[2:]]
    model = PoseModel.of(given, observed, adjusts_lens)
    unknowns = rng.normal(size=model.sharing.toarray().shape[1])
    return model, (model.sharing @ unknowns).reshape(model.given.shape), observed


def with_intrinsics(camera: Camera, focal: float, right: float, down: float) -> Camera:
    """The camera with another focal length and principal point, by these differences in px."""
    K = camera.K.copy()
    K[:2, :2] *= 1 + focal / FOCAL
    K[:2, 2] += right, down
    return Camera(K @ camera.camera_from_world, camera.width, camera.height)


@pytest.mark.parametrize("adjusts_lens", [False, True], ids=["poses", "lens"])
@pytest.mark.parametrize("scale", [1.0, 300.0, 1e-4])
def test_derivatives_agree_with_central_differences(scale, adjusts_lens):
    model, poses, observed = small_problem(adjusts_lens=adjusts_lens)
    poses = np.column_stack([scale * poses[:, : PARAMETERS + 3], min(scale, 1.0) * poses[:, PARAMETERS + 3 :]])
    rounding = 1e-8  # of pixels far outside the photo, which a distortion moves still farther, by the step
    images = model.linearise(poses, observed)
    for j in range(poses.shape[1]):
        step = np.zeros(poses.shape[1])
        step[j] = 1e-3
        difference = (model.project(poses + step, observed)[0] - model.project(poses - step, observed)[0]) / 2e-3
        off = np.abs(images.J_pixel_wrt_pose[:, :, j] - difference)
        assert (off <= 1e-6 * (1 + np.abs(difference)) + rounding * np.abs(images.pixels)).all()
    for j in range(3):
        step = 1e-5 * np.eye(3)[j]
        difference = (
            model.project(poses, observed.at(observed.positions + step))[0]
            - model.project(poses, observed.at(observed.positions - step))[0]
        ) / 2e-5
        off = np.abs(images.J_pixel_wrt_point[:, :, j] - difference)
        assert (off <= 1e-4 + 1e-6 * np.abs(difference) + rounding * np.abs(images.pixels)).all()


def test_the_left_jacobian_is_continuous_where_its_series_begins():
    axis = np.array([0.6, -0.64, 0.48])
    below, above = left_jacobians(np.array([axis * 0.9999e-4, axis * 1.0001e-4]))
    np.testing.assert_allclose(below, above, atol=1e-7)


@pytest.mark.parametrize(("adjusts_lens", "sigma"), [(False, SIGMA), (True, SIGMA_LENS)], ids=["poses", "lens"])
def test_the_reduced_system_is_the_schur_complement_of_the_full_one(adjusts_lens, sigma):
    model, poses, observed = small_problem(adjusts_lens=adjusts_lens)
    system = reduced_system(model, poses, observed, loss := GemanMcClure(2.0), sigma)
    images = model.linearise(poses, observed)
    n_photo, n_poses, n = poses.shape[1], poses.size, poses.size + 3 * len(observed)
    J = np.zeros((2 * len(observed.point), n))
    for o, (p, v) in enumerate(zip(observed.point, observed.photo, strict=True)):
        J[2 * o : 2 * o + 2, n_photo * v : n_photo * (v + 1)] = images.J_pixel_wrt_pose[o]
        J[2 * o : 2 * o + 2, n_poses + 3 * p : n_poses + 3 * p + 3] = images.J_pixel_wrt_point[o]
    weight = np.repeat(loss.weight(residual_lengths(model, poses, observed)), 2) / sigma.observation**2
    H = J.T @ (weight[:, None] * J)
    H[:n_poses, :n_poses] += np.diag(sigma.prior(model).ravel())
    g = J.T @ (weight * (images.pixels - observed.pixels).ravel())
    g[:n_poses] += (poses * sigma.prior(model)).ravel()
    U, W, V = H[:n_poses, :n_poses], H[:n_poses, n_poses:], H[n_poses:, n_poses:]
    T = model.sharing.toarray()
    expected = T.T @ (U - W @ np.linalg.solve(V, W.T)) @ T
    np.testing.assert_allclose(system.S, expected, rtol=1e-5, atol=1e-5 * np.abs(U).max())
    expected = T.T @ (g[:n_poses] - W @ np.linalg.solve(V, g[n_poses:]))
    np.testing.assert_allclose(system.g, expected, rtol=1e-5, atol=1e-6 * np.abs(g).max())


@pytest.mark.parametrize(("adjusts_lens", "sigma"), [(False, SIGMA), (True, SIGMA_LENS)], ids=["poses", "lens"])
@pytest.mark.parametrize("loss", [Square(), Huber(1.0), GemanMcClure(3.0)], ids=["square", "huber", "geman-mcclure"])
def test_the_adjustment_ends_where_scipy_ends(loss, adjusts_lens, sigma):
    model, _, observed = small_problem(adjusts_lens=adjusts_lens)
    ours = adjust(model, model.given, observed, loss, sigma, 200)
    n = model.sharing.toarray().shape[1]

    def residuals(x: np.ndarray) -> np.ndarray:
        """Residuals whose half sum of squares is the objective; of shared intrinsics there is one prior."""
        poses, points = (model.sharing @ x[:n]).reshape(model.given.shape), x[n:].reshape(-1, 3)
        r = model.project(poses, observed.at(points))[0] - observed.pixels
        lengths = np.linalg.norm(r, axis=1)
        data = (r * np.sqrt(2 * loss.value(lengths) / lengths**2)[:, None] / sigma.observation).ravel()
        of_poses = poses[:, :PARAMETERS] / np.repeat([sigma.rotation, sigma.center], 3)
        return np.concatenate([data, of_poses.ravel(), x[4 * PARAMETERS : n] / (sigma.lens or 1)])

    unknowns = np.linalg.lstsq(model.sharing.toarray(), ours.poses.ravel())[0]
    start = np.concatenate([unknowns, ours.points.ravel()])
    start += 1e-3 * np.random.default_rng(0).normal(size=start.shape)
    theirs = least_squares(residuals, start, x_scale="jac", ftol=1e-10, max_nfev=60)
    assert ours.objectives[-1] <= theirs.cost * (1 + 1e-3), (ours.objectives[-1], theirs.cost)
    np.testing.assert_allclose(ours.poses.ravel(), model.sharing @ theirs.x[:n], atol=0.02)


def test_an_adjustment_never_raises_its_objective():
    model, poses, observed = small_problem(wrong=40.0)
    found = adjust(model, 20 * poses, observed, GemanMcClure(2.0), SIGMA, 30)
    assert (np.diff(found.objectives) <= 0).all(), found.objectives
    end = objective(model, found.poses, observed.at(found.points), GemanMcClure(2.0), SIGMA)
    assert end == found.objectives[-1] < found.objectives[0]


def test_triangulation_raises_the_loss_of_no_point():
    model, poses, observed = small_problem()
    loss = GemanMcClure(2.0)
    before, after = (
        np.bincount(observed.point, loss.value(residual_lengths(model, poses, observed.at(points))))
        for points in (observed.positions, triangulate(model, poses, observed, loss, 20))
    )
    assert (after <= before).all()
    assert after.sum() < before.sum()


def test_a_point_behind_its_camera_has_no_weight():
    model, poses, observed = small_problem()
    positions = observed.positions.copy()
    positions[0] = [0, 0, -50]
    system = reduced_system(model, poses, observed.at(positions), GemanMcClure(2.0), SIGMA)
    assert np.isfinite(system.S).all()
    assert np.isfinite(system.g).all()


@pytest.mark.parametrize("px", [0.5, 1.5])
def test_turned_cameras_recover_within_their_covariance_and_deviations_are_found(px):
    rng, true = np.random.default_rng(5), ring(10)
    observed = observed_by(true, 500, 0.2, rng, outliers=0.03)
    given = turned(true, px, rng)
    model = PoseModel.of(given, observed)
    found = estimate_poses(model, observed)
    wrong, left = (
        np.sqrt((rotation_errors(c, true) ** 2).mean()) for c in (given, model.cameras_at(found.poses, given))
    )
    assert left < 0.4 * wrong, (wrong, left)
    assert found.sigma.rotation == pytest.approx(px, rel=0.4)
    assert found.sigma.center < 0.1
    assert found.sigma.observation == pytest.approx(0.2, rel=0.1)
    observed = observed.at(found.points)
    assert np.median(residual_lengths(model, found.poses, observed)) < 0.25
    S = reduced_system(model, found.poses, observed, loss_at(found.sigma.observation), found.sigma).S
    off = (found.poses - turns_to(true, given, model)).ravel()
    assert off @ S @ off < 100  # chi squared: 60 parameters, exceeded by 1 in 1000


def test_shifted_cameras_recover_too():
    rng, true = np.random.default_rng(6), ring(12)
    observed = observed_by(true, 800, 0.2, rng)
    given = turned(true, 0.5, rng, shift=0.01)  # 1.3 px
    model = PoseModel.of(given, observed)
    found = estimate_poses(model, observed)
    cameras = model.cameras_at(found.poses, given)
    wrong, left = (
        np.sqrt(np.mean([np.sum((a.center - b.center) ** 2) for a, b in zip(c, true, strict=True)]))
        for c in (given, cameras)
    )
    assert left < wrong, (wrong, left)
    assert found.sigma.center == pytest.approx(0.01 * FOCAL / 6.5, rel=0.4)


def test_exact_cameras_stay_and_the_judge_keeps_the_given_ones():
    rng, true = np.random.default_rng(7), ring(8)
    observed = observed_by(true, 800, 0.2, rng, outliers=0.03)
    held_out = is_held_out(len(observed))
    training, judges = observed.chosen(~held_out), observed.chosen(held_out)
    model = PoseModel.of(true, training)
    found = estimate_poses(model, training)
    assert rotation_errors(model.cameras_at(found.poses, true), true).max() < 0.05
    judgement = judge_cameras(model, model.given, found.poses, judges, found.sigma.observation)
    assert not judgement.is_clear, judgement


def test_the_judge_takes_what_is_clearly_better_and_refuses_what_is_worse():
    rng, true = np.random.default_rng(8), ring(8)
    observed = observed_by(true, 400, 0.2, rng)
    wrong = turned(true, 0.7, rng)
    of_wrong, of_true = (PoseModel.of(cameras, observed) for cameras in (wrong, true))
    assert judge_cameras(of_wrong, of_wrong.given, turns_to(true, wrong, of_wrong), observed, 0.2).is_clear
    assert not judge_cameras(of_true, of_true.given, turns_to(wrong, true, of_true), observed, 0.2).is_clear
    assert not judge_cameras(of_true, of_true.given, of_true.given, observed, 0.2).is_clear


def test_the_unit_of_the_world_changes_no_pose():
    rng, true = np.random.default_rng(9), ring(5)
    observed = observed_by(true, 150, 0.2, rng)
    given = turned(true, 1.0, rng)
    large = [
        Camera.from_krt(c.K, c.camera_from_world[:, :3], 1000 * c.camera_from_world[:, 3], WIDTH, HEIGHT) for c in given
    ]
    one = estimate_poses(PoseModel.of(given, observed), observed)
    thousand = observed.at(1000 * observed.positions)
    other = estimate_poses(PoseModel.of(large, thousand), thousand)
    np.testing.assert_allclose(one.poses, other.poses, atol=1e-4)


def test_points_are_chosen_with_their_observations():
    _, _, observed = small_problem()
    mask = np.arange(len(observed)) % 3 == 0
    chosen = observed.chosen(mask)
    assert len(chosen) == mask.sum()
    np.testing.assert_array_equal(np.bincount(chosen.point), np.bincount(observed.point)[mask])
    shared = observed.shares_observation(chosen)
    np.testing.assert_array_equal(shared, mask)
    far = replace(chosen, pixels=chosen.pixels + 0.5)
    assert not observed.shares_observation(far).any()


@pytest.mark.parametrize(("px", "is_released"), [(2.0, False), (20.0, True)])
def test_one_wrong_camera_among_exact_ones_is_corrected(px, is_released):
    rng, true = np.random.default_rng(11), ring(9)
    observed = observed_by(true, 500, 0.2, rng)
    given = [*true[:4], turned(true[4:5], px, rng)[0], *true[5:]]
    model = PoseModel.of(given, observed)
    assert find_misfits(model, np.zeros((9, PARAMETERS)), observed)[4] == is_released
    found = estimate_poses(model, observed)
    np.testing.assert_array_equal(found.model.trust < 1, is_released & (np.arange(9) == 4))
    wrong, left = (rotation_errors(c, true).max() for c in (given, model.cameras_at(found.poses, given)))
    assert left < 0.15 * wrong, (wrong, left)
    assert not find_misfits(model, found.poses, observed.at(found.points)).any()


def test_a_resection_changes_one_pose_and_not_that_of_a_photo_with_few_observations():
    rng, true = np.random.default_rng(12), ring(6)
    observed = observed_by(true, 100, 0.2, rng)
    model, nowhere = PoseModel.of(turned(true, 3.0, rng), observed), np.zeros((6, PARAMETERS))
    poses = resected(model, nowhere, observed, 2)
    assert (poses[2] != 0).all()
    assert (np.delete(poses, 2, axis=0) == 0).all()
    few = observed.chosen(np.arange(len(observed)) < 3)
    assert resected(model, nowhere, few, 2) is nowhere


def test_intrinsics_of_shared_cameras_are_found():
    rng, true = np.random.default_rng(13), ring(10)
    observed = observed_by(true, 600, 0.2, rng, outliers=0.03)
    given = [with_intrinsics(camera, -9.0, 1.5, -1.0) for camera in turned(true, 0.3, rng)]
    lengths = {}
    for adjusts_lens in (False, True):
        model = PoseModel.of(given, observed, adjusts_lens)
        found = estimate_poses(model, observed)
        cameras = model.cameras_at(found.poses, given)
        lengths[adjusts_lens] = np.median(residual_lengths(model, found.poses, observed.at(found.points)))
    np.testing.assert_allclose([camera.K for camera in cameras], np.broadcast_to(cameras[0].K, (10, 3, 3)), atol=1e-9)
    off = cameras[0].K - true[0].K
    assert abs(off[0, 0]) < 3.0, off  # was 9
    assert np.abs(off[:2, 2]).max() < 0.7, off  # was 1.5
    assert lengths[True] < lengths[False]
    assert found.sigma.lens is not None


K1, K2 = -0.03, 0.02


def bent(observed: ObservedPoints, cameras: list[Camera], k1: float = K1, k2: float = K2) -> ObservedPoints:
    """The observations as lenses with K1 and K2 show them, by OpenCV."""
    pixels = np.empty_like(observed.pixels)
    for v, camera in enumerate(cameras):
        mine = observed.photo == v
        rays = np.linalg.solve(camera.K, np.column_stack([observed.pixels[mine], np.ones(mine.sum())]).T).T
        coefficients = np.array([k1, k2, 0, 0])
        straight = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), np.eye(3), coefficients)[0][:, 0]
        pixels[mine] = straight @ camera.K[:2, :2].T + camera.K[:2, 2]
    return replace(observed, pixels=pixels)


def test_the_distortion_of_a_shared_lens_is_found():
    rng, true = np.random.default_rng(14), ring(10)
    observed = bent(observed_by(true, 600, 0.2, rng, outliers=0.03), true)
    given = turned(true, 0.3, rng)
    model = PoseModel.of(given, observed, adjusts_lens=True)
    found = estimate_poses(model, observed)
    lenses = model.lenses_at(found.poses, given)
    np.testing.assert_allclose([lens.distortion for lens in lenses], [lenses[0].distortion] * 10, atol=1e-12)
    # What matters is where the lens shows a ray, not k1 and k2, which do much the same within the photo.
    rays = np.column_stack([np.linspace(0, 0.4, 9), np.zeros(9)])
    radius = np.linalg.norm(rays, axis=1)
    expected = FOCAL * radius * (1 + K1 * radius**2 + K2 * radius**4)
    shown = lenses[0].distort(rays * np.diag(lenses[0].pinhole_K)[:2] + lenses[0].pinhole_K[:2, 2])
    np.testing.assert_allclose(shown[:, 0] - lenses[0].K[0, 2], expected, atol=0.3)  # without: 1.7 px at the corner
    assert np.median(residual_lengths(model, found.poses, observed.at(found.points))) < 0.3


def test_a_given_distortion_is_not_adjusted():
    rng, true = np.random.default_rng(15), ring(6)
    observed = bent(observed_by(true, 200, 0.2, rng), true)
    model = PoseModel.of(true, observed, adjusts_lens=True, is_bent=[True, True, True, False, False, False])
    assert len(set(model.lens)) == 2, "photos with and without a given distortion share no intrinsics"
    found = estimate_poses(model, observed)
    lenses = model.lenses_at(found.poses, true)
    assert [lens.is_distorted for lens in lenses] == [True] * 3 + [False] * 3


@pytest.mark.parametrize("turn", [0.0, 0.5])
@pytest.mark.parametrize("is_bent", [True, False])
def test_photos_that_look_distorted_are_known_from_wrong_poses(turn, is_bent):
    rng, true, strong = np.random.default_rng(17), ring(10), (-0.15, 0.05)
    seen = observed_by(true, 800, 0.2, rng, outliers=0.03)
    observed = bent(seen, true, *strong) if is_bent else seen
    given = turned(true, turn, rng) if turn else true
    held_out = is_held_out(len(observed))
    training, judges = observed.chosen(~held_out), observed.chosen(held_out)
    estimate = estimate_poses(PoseModel.of(given, training), training)
    note = lens_note(estimate, training, judges, lambda *_: None)
    if is_bent:
        assert "--cameras refine_lens" in note
        farthest = np.linalg.norm(observed.pixels - true[0].K[:2, 2], axis=1).max() / FOCAL
        bend = FOCAL * abs(strong[0] * farthest**3 + strong[1] * farthest**5)
        assert float(note.split("up to ")[1].split(" px")[0]) == pytest.approx(bend, rel=0.25), note
    else:
        assert note == ""


def test_held_out_observations_are_known_again_after_undistortion():
    rng, true = np.random.default_rng(16), ring(4)
    observed = observed_by(true, 60, 0.2, rng)
    lenses = [Lens(camera.K, np.array([K1, K2]), WIDTH, HEIGHT) for camera in true]
    pixels = observed.pixels.copy()
    for v, lens in enumerate(lenses):
        pixels[observed.photo == v] = lens.undistort(pixels[observed.photo == v])
    shown = np.bincount(observed.point, ~np.isfinite(pixels).all(axis=1)) == 0
    again = replace(observed, pixels=pixels).distorted(lenses)
    assert shown.sum() > 50
    assert again.shares_observation(observed)[shown].all()
    assert (again.pixels != observed.pixels).any(), "nothing was changed by rounding"
