"""Smoothing by geometry alone, and runs from a noisy start."""

import numpy as np
import pytest

from fairing.geometry.normal_filter import smoothed
from fairing.mesh import Mesh
from fairing.run.session import Session
from fairing.run.stages import PASSES
from fairing.stage_kind import StageKind
from fairing.trace import StepReason, Trace
from tests.prior_to_start import origin_of
from tests.small_scene import FACES, VERTICES, corner_scene, small_options

SMOOTHING = {"smoothing": [0.1, 0.03, 0.01]}


def folded_sheet(side: int = 12) -> Mesh:
    """Two planes that meet at a right angle along x = 0, one unit between vertices."""
    x, y = (a.ravel() for a in np.meshgrid(np.arange(-side, side + 1.0), np.arange(side + 1.0), indexing="ij"))
    index = np.arange(len(x)).reshape(2 * side + 1, side + 1)
    a, b, c, d = (i.ravel() for i in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    faces = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return Mesh(np.column_stack([np.minimum(x, 0), y, np.maximum(x, 0)]), faces)


def off_the_planes(vertices: np.ndarray) -> np.ndarray:
    """Distance to the nearer of the half planes z = 0, x <= 0 and x = 0, z >= 0."""
    x, _, z = vertices.T
    return np.minimum(np.hypot(np.maximum(x, 0), z), np.hypot(x, np.minimum(z, 0)))


def noisy(mesh: Mesh, size: float, seed: int = 0) -> np.ndarray:
    return mesh.vertices + size * np.random.default_rng(seed).standard_normal(mesh.vertices.shape)


def test_noise_is_halved_and_the_crease_stays():
    sheet = folded_sheet()
    start = noisy(sheet, 0.06)
    result = smoothed(sheet, start, 5)
    assert off_the_planes(result).mean() < 0.5 * off_the_planes(start).mean()
    crease = sheet.vertices[:, 0] + sheet.vertices[:, 2] == 0
    assert off_the_planes(result)[crease].mean() < off_the_planes(start)[crease].mean()


@pytest.mark.parametrize("mesh", [folded_sheet(), Mesh(VERTICES, FACES)], ids=["sheet", "corner"])
def test_what_is_flat_between_its_creases_does_not_move(mesh):
    # Across a right angle a normal weighs exp(-25).
    assert np.abs(smoothed(mesh, mesh.vertices, 5) - mesh.vertices).max() < 1e-9


def test_smoothing_is_free_of_units_and_orders():
    sheet = folded_sheet(4)
    start = noisy(sheet, 0.1)
    expected = smoothed(sheet, start, 3)
    assert smoothed(sheet, 1000 * start + 5e4, 3) == pytest.approx(1000 * expected + 5e4, abs=1e-6)
    order = np.random.default_rng(1).permutation(len(sheet.faces))
    assert smoothed(Mesh(sheet.vertices, sheet.faces[order]), start, 3) == pytest.approx(expected, abs=1e-12)


def noisy_session(**changes) -> Session:
    return Session(corner_scene(), small_options(step=SMOOTHING, **changes))


def test_a_noisy_start_is_smoothed_first_and_the_photos_agree():
    session = noisy_session()
    assert session.make_plan().is_smoothed
    session.run()
    steps = session.trace.steps
    kinds = [step.stage for step in steps]
    passes = kinds.index(StageKind.JUDGE)
    assert 1 <= passes <= PASSES
    assert kinds[:passes] == passes * [StageKind.SMOOTHNESS]
    verdict = steps[passes]
    assert not (verdict.reasons == StepReason.REJECTED_FIT).any()
    assert verdict.objective_after < 0.95 * verdict.objective_before
    np.testing.assert_array_equal(origin_of(session.sweep_state(passes + 1)), session.trace.vertices_at(passes + 1))
    assert StageKind.SMOOTHNESS not in kinds[passes:]
    before, after = (np.linalg.norm(v[0] - VERTICES[0]) for v in (session.trace.start, session.vertices))
    assert after < 0.3 * before


def test_the_passes_of_a_run_are_those_of_the_filter():
    session = noisy_session()
    session.make_plan()
    mesh, passes = session.scene.mesh, 0
    while session.step() is not None and session.trace.steps[-1].stage is StageKind.SMOOTHNESS:
        passes += 1
        np.testing.assert_allclose(session.vertices, smoothed(mesh, mesh.vertices, passes), atol=1e-12)
    assert passes > 0


def test_a_start_at_its_place_is_not_smoothed():
    session = Session(corner_scene((0, 0, 0)), small_options(step=SMOOTHING))
    assert not session.make_plan().is_smoothed
    record = session.step()
    assert record is not None
    assert record.stage is StageKind.PHOTOS


def test_locked_vertices_are_not_smoothed():
    session = noisy_session(locked_vertices=(1, 2, 3, 4, 5, 6))
    session.run()
    assert np.array_equal(session.vertices[1:], session.trace.start[1:])


def test_a_smoothed_run_resumes_to_the_same_bytes(tmp_path):
    whole = noisy_session()
    whole.run()
    begun = noisy_session()
    begun.trace.attach(tmp_path / "run.trace")
    for _ in range(2):
        begun.step()
    begun.trace.detach()
    resumed = Session(whole.scene, trace=Trace.load(tmp_path / "run.trace"))
    resumed.run()
    assert np.array_equal(resumed.vertices, whole.vertices)
    assert len(resumed.trace) == len(whole.trace)
