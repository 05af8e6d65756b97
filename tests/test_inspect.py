"""Cells recomputed from a trace are those of the run: energies to the bit, consistent parts, samples at the right pixels."""

import numpy as np
import pytest

from fairing.cells.context import CellContext
from fairing.errors import InputError
from fairing.judge.inspect import cells_in_context, energies_by_dimension, face_cells
from fairing.kernels.eigenspace import GRAM_BLOCK
from fairing.options import FairingOptions
from fairing.run.session import Session
from fairing.trace import Trace
from tests.blurred_photo import blurred
from tests.rounding import few, of_sum
from tests.small_scene import corner_scene, small_options

pytestmark = pytest.mark.compiled


def run(steps: int, options: FairingOptions | None = None) -> Session:
    session = Session(corner_scene(), options or small_options())
    for _ in range(steps):
        session.step()
    return session


VARIANTS = {
    "accurate": small_options(),
    "paper": small_options("paper"),
    "centered": small_options(eigenspace={"centered": True}),
    "colour, means removed": small_options(cells={"color": True, "remove_bias": True}),
    "huber, cubic": small_options(robust={"norm": "huber"}, cells={"interpolation": ["cubic"]}),
    "least squares, sequential": small_options(robust={"norm": "least_squares"}, schedule={"order": "sequential"}),
    "printed norm": small_options(robust={"norm": "geman_mcclure_printed"}),
}


@pytest.mark.parametrize("name", VARIANTS)
def test_energies_equal_the_recorded_ones_to_the_bit(name):
    session = run(10, VARIANTS[name])
    for moment, record in enumerate(session.trace.steps):
        for face, recorded in zip(record.faces.tolist(), record.face_energy_before.tolist(), strict=True):
            cells = face_cells(session, face, moment)
            assert cells.energy == recorded, f"moment {moment}, face {face}"
            by_sample = (cells.pair_weight * cells.rho.sum(axis=1)).sum()
            # The kernel sums in float32 over up to 3 * 8256 samples.
            assert by_sample == pytest.approx(recorded, rel=of_sum(3 * 8256))


@pytest.mark.parametrize("name", VARIANTS)
def test_observed_is_reconstruction_plus_residual_and_reconstruction_lies_in_the_eigenspace(name):
    session = run(3, VARIANTS[name])
    cells = face_cells(session, 2)
    difference = np.where(cells.counts, cells.observed - cells.reconstruction - cells.residual, 0)
    assert np.abs(difference).max() < few(16) * 255
    # Through the Gram matrix in float32 a singular vector is known to (s_1 / s_m)^2 roundings of its sums.
    rounding = of_sum(GRAM_BLOCK) * np.outer(
        *2 * [cells.singular_values[0] / cells.singular_values[: len(cells.basis)]]
    )
    assert (np.abs(cells.basis @ cells.basis.T - np.eye(len(cells.basis))) < rounding).all()
    offset = cells.reconstruction - cells.coefficients @ cells.basis
    if name.startswith("colour"):
        offset = offset - np.median(offset, axis=1, keepdims=True)
    if name == "centered":
        offset = offset - np.median(offset, axis=0)
    assert np.abs(offset[cells.counts]).max() < 2e-3


def test_masked_samples_have_no_residual_but_a_reconstruction():
    session = run(0)
    cells = face_cells(session, 0)
    assert not cells.counts.all()
    assert not cells.residual[~cells.counts].any()
    assert np.isfinite(cells.reconstruction).all()
    assert np.ptp(cells.reconstruction[~cells.counts]) > 20


def test_each_sample_is_at_its_position_in_the_photo():
    session = run(0, small_options(cells={"warp": "affine", "adaptive": False, "size": [24]}))
    cells = face_cells(session, 1)
    images = cells.as_images(cells.observed)
    photo = blurred(cells.views[0], session.options.levels[0].blur)
    for row, column in [(0, 0), (0, 23), (23, 0), (7, 9)]:
        a, b = (column + 1 / 3) / 24, (row + 1 / 3) / 24
        x, y = a * cells.corners_px[0, 0] + b * cells.corners_px[0, 1] + (1 - a - b) * cells.corners_px[0, 2]
        i, j, fx, fy = int(y), int(x), x % 1, y % 1
        expected = (1 - fy) * ((1 - fx) * photo[i, j] + fx * photo[i, j + 1]) + fy * (
            (1 - fx) * photo[i + 1, j] + fx * photo[i + 1, j + 1]
        )
        assert images[0, row, column] == pytest.approx(expected, abs=1e-2)
    assert np.isnan(images[0, 12, 12])
    assert np.isfinite(images).sum() == cells.observed.size


def test_past_moments_and_a_loaded_trace_give_the_same_cells(tmp_path):
    session = run(6)
    session.trace.attach(tmp_path / "run.trace")
    session.trace.detach()
    loaded = Session(corner_scene(), trace=Trace.load(tmp_path / "run.trace"))
    for moment in (5, 0, 3):
        one, other = face_cells(session, 4, moment), face_cells(loaded, 4, moment)
        for name in ("observed", "reconstruction", "residual", "weights", "basis", "singular_values"):
            assert np.array_equal(getattr(one, name), getattr(other, name)), name
    assert session.moment == 6


def test_a_face_that_takes_no_part_shows_its_cells_without_an_energy():
    session = run(0, small_options(visibility={"max_views": 4}))
    session.sweep_state().context.kernel.face_dimensions[0] = 0
    cells = face_cells(session, 0)
    assert not cells.takes_part
    assert cells.energy == 0
    assert cells.observed.shape[0] == 4


def test_unknown_faces_and_moments_are_refused():
    session = run(1)
    with pytest.raises(IndexError, match="faces 0 to 5"):
        face_cells(session, 6)
    with pytest.raises(IndexError, match="moments 0 to 1"):
        face_cells(session, 0, 2)


def test_another_k_does_not_change_the_run():
    session = run(2, small_options(eigenspace={"dimensions": [2]}))
    own, energies = face_cells(session, 1), energies_by_dimension(session, 1)
    assert len(energies) == len(own.views) - 2
    assert energies[1] == own.energy
    assert (np.diff(energies) < 0).all()
    other = face_cells(session, 1, dimensions=4)
    assert len(other.basis) == 4
    assert other.energy == energies[3]
    assert other.sigma == own.sigma
    assert face_cells(session, 1).energy == own.energy
    for k in (0, len(own.views) - 1):
        with pytest.raises(InputError, match=f"k = {k}: face 1"):
            face_cells(session, 1, dimensions=k)


def test_cells_for_distant_positions_read_the_photos_there():
    """Patches of a sweep end a few pixels around each face; those for moves contain the faces at all given positions."""
    session = Session(corner_scene(), small_options())
    session.run()
    moment = len(session.trace)
    vertices, sweep = session.trace.vertices_at(moment), session.sweep_state(moment)
    distant = vertices[0] + np.array([[0.3, 0.3, -0.3], [0.5, 0, 0]])
    near, far = (session.context_for_moves(0, moment, positions) for positions in (distant[:1], distant))

    def energies(context: CellContext, by: float) -> np.ndarray:
        moved = vertices.copy()
        moved[0] += by * (distant[0] - vertices[0])
        found = [
            cells_in_context(session, context, moved, face, moment, float(sweep.sigma[face]), float(sweep.scale[face]))
            for face in range(6)
        ]
        return np.array([cells.energy for cells in found])

    assert np.array_equal(near.kernel.face_dimensions, sweep.context.kernel.face_dimensions)
    for by in (0.1, 1.0):
        np.testing.assert_allclose(energies(near, by), energies(far, by), rtol=2e-3)
    np.testing.assert_allclose(energies(near, 0.1), energies(sweep.context, 0.1), rtol=2e-3)
    assert np.abs(energies(sweep.context, 1.0) / energies(near, 1.0) - 1).max() > 0.02
