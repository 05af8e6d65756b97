"""The algorithm of the paper in NumPy: its derivatives, and the preset `paper` of the engine against it."""

from dataclasses import replace

import numpy as np
import pytest

from fairing import paper
from fairing.options import PRESETS
from fairing.photo import ArrayPhoto
from fairing.run.session import Session
from fairing.scene import Scene
from tests.small_scene import START, VERTICES, corner_scene

CORNER = 0


def grey_corner() -> Scene:
    """The corner in grey photos, whose luma the engine, which rounds it to eighths of a grey level, represents exactly."""
    scene = corner_scene()
    photos = [np.rint(view.photo.load() @ paper.LUMA).astype(np.uint8) for view in scene.views]
    views = [
        replace(view, photo=ArrayPhoto(np.repeat(photo[:, :, None], 3, axis=2)))
        for view, photo in zip(scene.views, photos, strict=True)
    ]
    return replace(scene, views=views)


def begun(scene: Scene, sigma_smooth: float) -> paper.Sweep:
    photos = [paper.smoothed(view.photo.load(), sigma_smooth) for view in scene.views]
    return paper.begin_sweep(scene, photos, scene.mesh.vertices, sigma_smooth)


def test_the_derivative_of_the_cells_is_their_slope():
    scene, sweep = grey_corner(), begun(grey_corner(), 2.4)
    h, vertices = 1e-5, scene.mesh.vertices
    face = sweep.faces(CORNER)[0]
    view = sweep.views(face)[0]
    camera, corner = scene.views[view].camera, int(np.argmax(scene.mesh.faces[face] == CORNER))
    cell = sweep.cells(vertices, face)[0]
    derivative = paper.residual_derivative(cell, camera, vertices[CORNER], corner)
    for axis in range(3):
        ahead, behind = vertices.copy(), vertices.copy()
        ahead[CORNER, axis] += h
        behind[CORNER, axis] -= h
        images = [sweep.cells(at, face)[0].image for at in (ahead, behind)]
        slope = (images[0] - images[1]) / (2 * h)
        # Samples that cross into another pixel square have another slope: few do within 1e-5 of an edge.
        close = np.isclose(derivative[:, axis], slope, rtol=1e-3, atol=1e-2 * np.abs(slope).max())
        assert close.mean() > 0.995, close.mean()


def test_the_influence_function_is_the_slope_of_the_norm_and_the_secant_its_ratio():
    e, h = np.linspace(-60, 60, 241), 1e-5
    slope = (paper.rho(e + h, 17.0) - paper.rho(e - h, 17.0)) / (2 * h)
    np.testing.assert_allclose(paper.rho_dot(e, 17.0), slope, atol=1e-9)
    np.testing.assert_allclose(paper.secant(e, 17.0) * e, paper.rho_dot(e, 17.0), atol=1e-15)
    assert e[np.argmax(paper.rho_dot(e, 17.0))] == pytest.approx(17 / np.sqrt(3), abs=0.5)


def test_cells_of_a_plane_seen_without_perspective_are_explained_by_one_basis_image():
    rng = np.random.default_rng(5)
    images = np.outer(rng.uniform(0.5, 1.5, 8), rng.uniform(0, 255, 400))
    assert np.abs(paper.residual(images)).max() < 1e-9


# Beyond the first dimension the basis images belong to small singular values, and inherit the single precision of the cells'
# Gram matrix, divided by them (`kernels.eigenspace`).
@pytest.mark.slow
@pytest.mark.parametrize(("k", "rounding"), [(1, 2e-4), (5, 5e-3)])
def test_the_preset_paper_takes_the_steps_of_the_paper(k: int, rounding: float, monkeypatch: pytest.MonkeyPatch):
    scene, options = grey_corner(), PRESETS["paper"]
    monkeypatch.setattr(paper, "DIMENSIONS", k)
    options = replace(options, visibility=replace(options.visibility, edge_margin=0.0)).with_levels(dimensions=k)
    session = Session(scene, options)
    sweep = session.sweep_state()
    sweep.context.kernel.pair_mask[:] = -1  # the paper leaves out no sample
    object.__setattr__(sweep, "system", None)
    twin = begun(scene, options.levels[0].blur)
    assert (twin.seen == (sweep.context.reasons <= 1)).all()
    twin = twin._replace(sigma=sweep.sigma)  # the engine's is without the samples that masks leave out
    for _ in range(4):
        vertices, record = session.vertices, session.step()
        assert record is not None
        assert record.vertices.tolist() == [CORNER]
        expected = paper.fairing_step(twin, vertices, CORNER, float(record.damping[0]))
        np.testing.assert_allclose(record.proposed[0], expected, rtol=rounding)
        assert record.objective_before == pytest.approx(twin.energy(vertices, CORNER), rel=rounding)


def test_a_run_by_the_paper_brings_the_corner_nearer_and_moves_no_other_vertex(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(paper, "SMOOTHING", (2.4,))
    monkeypatch.setattr(paper, "SWEEPS", 3)
    monkeypatch.setattr(paper, "CELL_SIZE", 32)
    monkeypatch.setattr(paper, "DIMENSIONS", 1)  # five of eight photos' dimensions absorb the error
    scene = grey_corner()
    vertices = paper.fair_by_the_paper(scene, [CORNER])
    error = np.linalg.norm(vertices[CORNER] - VERTICES[CORNER])
    assert error < 0.8 * np.linalg.norm(START), error
    assert (vertices[1:] == scene.mesh.vertices[1:]).all()
