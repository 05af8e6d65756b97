"""Surface sweep: points on the true surface from a displaced mesh, correlation against numpy, and runs that use the points."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from fairing.errors import Cancelled
from fairing.features import surface_sweep
from fairing.features.points import FeaturePoints
from fairing.features.surface_sweep import HALF_WINDOW, SurfaceSweep
from fairing.photo import ArrayPhoto, Mask
from fairing.run import fits
from fairing.run.session import Session
from fairing.scene import Scene, SparsePoints
from fairing.stage_kind import StageKind
from tests.rounding import few
from tests.small_scene import VERTICES, corner_scene, small_options

pytestmark = pytest.mark.compiled

ERROR = 6.0  # px: the corner is about so far off
FAR = (0.09, -0.06, 0.075)


def swept_points(scene: Scene, threads: int = 2) -> FeaturePoints:
    with ThreadPoolExecutor(threads) as pool:
        return SurfaceSweep(scene.views, pool).points(scene.mesh, ERROR)


def off_the_cube(positions: np.ndarray) -> np.ndarray:
    """(p,) float: distances to the unit cube's nearest side plane."""
    return np.abs(positions - 1).min(axis=1)


def observed(scene: Scene) -> Scene:
    """The scene with exact points on the cube's sides that every photo observes."""
    rng = np.random.default_rng(4)
    positions = rng.uniform(0.05, 0.95, (400, 3))
    positions[np.arange(400), rng.integers(3, size=400)] = 1.0
    seen = np.array([(p, v) for p in range(400) for v in range(len(scene.views))])
    pixels = np.array([scene.views[v].camera.project(positions[p])[0] for p, v in seen])
    return replace(scene, sparse_points=SparsePoints(positions, np.zeros((400, 3), np.uint8), seen, pixels, "own"))


def test_points_lie_on_the_true_surface_although_the_mesh_does_not():
    scene = corner_scene(FAR)
    found = swept_points(scene)
    pixel = 4 / 230  # of the photos, in edges of the cube
    distance = off_the_cube(found.positions)
    assert len(found) > 200
    assert np.median(distance) < 0.5 * pixel
    assert (distance < 2 * pixel).mean() > 0.9
    # The mesh itself is farther off at these points: a sweep that found nothing would give its own surface back.
    near = np.linalg.norm(found.positions - VERTICES[0], axis=1) < 0.4
    shift = np.linalg.norm(FAR) * (1 - np.linalg.norm(found.positions[near] - VERTICES[0], axis=1).mean())
    assert off_the_cube(found.positions[near]).mean() < 0.3 * shift


def test_the_points_do_not_depend_on_threads_and_their_number_on_a_face_is_limited(monkeypatch: pytest.MonkeyPatch):
    scene = corner_scene(FAR)
    one, two = swept_points(scene, 1), swept_points(scene, 2)
    assert one.positions.tobytes() == two.positions.tobytes()
    assert one.photos.tobytes() == two.photos.tobytes()
    monkeypatch.setattr(surface_sweep, "POINTS_PER_FACE", 5)
    assert 0 < len(swept_points(scene)) <= 5 * (len(scene.mesh.faces) + 1)  # and those beside the mesh


def test_photos_without_texture_and_masked_pixels_have_no_points(tmp_path: Path):
    scene = corner_scene(FAR)
    flat = ArrayPhoto(np.full((120, 160, 3), 90, np.uint8))
    assert len(swept_points(replace(scene, views=tuple(replace(view, photo=flat) for view in scene.views)))) == 0
    right = np.ones((120, 160), bool)
    right[:, :80] = False
    nothing = np.zeros((120, 160), bool)

    def masked(mask: np.ndarray) -> FeaturePoints:
        cv2.imwrite(str(tmp_path / f"{mask.sum()}.png"), 255 * mask.astype(np.uint8))
        views = tuple(replace(view, mask=Mask(tmp_path / f"{mask.sum()}.png")) for view in scene.views)
        return swept_points(replace(scene, views=views))

    assert len(masked(nothing)) == 0
    found = masked(right)
    assert len(found) > 0
    for photo, camera in enumerate(view.camera for view in scene.views):
        uv, _ = camera.project(found.positions[found.photos == photo])
        assert (uv[:, 0] > 79).all()


def test_the_correlation_is_that_of_the_windows():
    rng = np.random.default_rng(0)
    a, b = (rng.normal(0, 30, (20, 24)).astype(np.float32) for _ in range(2))
    best, second = np.full(a.shape, -1, np.float32), np.full(a.shape, -1, np.float32)
    mean, contrast = np.empty_like(a), np.empty_like(a)
    surface_sweep._window_statistics(a, mean, contrast)
    surface_sweep._correlate(a, mean, contrast, b, best, second)
    for y, x in ((3, 3), (9, 12), (16, 20)):
        window = np.s_[y - HALF_WINDOW : y + HALF_WINDOW + 1, x - HALF_WINDOW : x + HALF_WINDOW + 1]
        p, q = (values[window].astype(float) for values in (a, b))
        covariance = ((p - p.mean()) * (q - q.mean())).mean()
        expected = covariance / np.sqrt((p.var() + surface_sweep.NOISE) * (q.var() + surface_sweep.NOISE))
        # Sums of 25 terms, times a few factors; the squares are those of grey levels, not of their differences to the mean.
        P, Q = ((values**2).mean() / (values.var() + surface_sweep.NOISE) for values in (p, q))
        assert best[y, x] == pytest.approx(expected, abs=few(30) * (P + Q + np.sqrt(P * Q)))
        assert mean[y, x] == pytest.approx(p.mean(), abs=few(27) * np.abs(p).mean())
        assert contrast[y, x] == pytest.approx((p.var() + surface_sweep.NOISE) ** -0.5, rel=few(30) * P)
    assert (second == -1).all()
    surface_sweep._correlate(a, mean, contrast, a, best, second)
    assert best[9, 12] > 0.98
    assert second[9, 12] < 0.9


def test_the_place_of_the_best_score_is_that_of_a_parabola_and_0_where_it_is_at_an_end_or_below_0():
    places = np.arange(7.0)
    profiles = [0.9 - 0.05 * (places - 3.3) ** 2, 0.9 - 0.01 * places, -0.1 - 0.05 * (places - 3.3) ** 2]
    scores = np.array(profiles, np.float32).T[:, None].copy()
    place = np.empty((1, 3), np.float32)
    surface_sweep._peaks(scores, place)
    # The place is a difference of scores over their second difference, which is 0.1.
    assert place[0] == pytest.approx([4.3, 0.0, 0.0], abs=few(8) * 0.9 / 0.1)


def test_a_sweep_can_be_cancelled():
    def check() -> None:
        raise Cancelled

    scene = corner_scene(FAR)
    with ThreadPoolExecutor(2) as pool, pytest.raises(Cancelled):
        SurfaceSweep(scene.views, pool, check).points(scene.mesh, ERROR)


def test_a_resumed_run_finds_the_points_again_and_ends_with_the_same_bytes(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(fits, "FAR_PX", 0.0)  # one of seven vertices is off: too few to count as far
    scene = observed(corner_scene(FAR))
    options = small_options(step={"points": [0.3]})
    whole = Session(scene, options)
    whole.run()
    assert whole.plan is not None
    assert whole.plan.is_fitted_to_points
    kinds = [step.stage for step in whole.trace.steps]
    searched = [k for k, kind in enumerate(kinds) if kind is StageKind.SURFACE_POINTS]
    assert searched, "the run finds points near the mesh"
    # Within the fit to these points, and by photos, whose prior to the points they pull at.
    for moment in (searched[1], kinds.index(StageKind.PHOTOS) + 1):
        resumed = Session(scene, trace=whole.trace.cut(moment))
        resumed.run()
        assert resumed.vertices.tobytes() == whole.vertices.tobytes()


def test_points_are_sought_near_large_faces_and_starts_that_the_points_move_far(monkeypatch: pytest.MonkeyPatch):
    """Twice, unless the second search would allow for the same error."""
    allowed = []

    def points(self: SurfaceSweep, mesh: object, error: float) -> FeaturePoints:
        allowed.append(error)
        return FeaturePoints.none("counted alone")

    def searches(displaced: tuple[float, float, float]) -> list[float]:
        allowed.clear()
        Session(observed(corner_scene(displaced)), small_options(step={"points": [0.3]})).make_plan()
        return list(allowed)

    near = (0.001, 0.0, 0.0)
    monkeypatch.setattr(SurfaceSweep, "points", points)
    assert searches(near) == [fits.FAR_ERROR]
    monkeypatch.setattr(fits, "typical_footprint", lambda *_: 0.0)  # px: small faces
    assert searches(near) == []
    monkeypatch.setattr(fits, "FAR_PART", 1 / 7)  # the corner alone
    first, second = searches(FAR)
    assert first > second >= max(first / 2, fits.FAR_ERROR)
    assert searches(near) == []
