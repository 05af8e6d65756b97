"""A trial of a step is the step that the engine then makes, and the parts that it shows add up to it."""

import numpy as np
import pytest

from fairing.judge.inspect import face_cells
from fairing.optimize.rows import linearised_sum
from fairing.run.session import Session
from fairing.stage_kind import StageKind
from tests.rounding import of_sum
from tests.small_scene import corner_scene, small_options

pytestmark = pytest.mark.compiled

VARIANTS = {
    "accurate": small_options(),
    "paper": small_options("paper"),
    "affine, alternating": small_options(cells={"warp": "affine"}, step={"solver": "alternating"}),
    "centered": small_options(eigenspace={"centered": True}),
    "means removed": small_options(cells={"color": True, "remove_bias": True}),
}


def run(steps: int, name: str = "accurate") -> Session:
    session = Session(corner_scene(), VARIANTS[name])
    for _ in range(steps):
        session.step()
    return session


@pytest.mark.parametrize("name", VARIANTS)
def test_trial_of_the_next_step_is_the_step_that_follows(name):
    tried, stepped = run(4, name), run(4, name)
    record = stepped.step()
    vertex = int(record.vertices[0])
    trial = tried.trial(vertex)
    assert trial.is_next
    assert len(tried.trace) == 4, "a trial records nothing"
    for field in ("before", "proposed", "after", "reasons", "face_energy_before", "face_energy_after", "damping"):
        assert np.array_equal(getattr(trial.record, field), getattr(record, field)), field
    assert np.array_equal(tried.step().after, record.after), "the step after a trial is the same"
    again = stepped.trial(vertex, 4)
    assert again.record is record, "a recorded outcome is not computed again"
    assert np.array_equal(again.proposal.proposed, record.proposed)


@pytest.mark.parametrize("name", VARIANTS)
def test_normal_matrix_of_a_vertex_is_the_sum_over_samples_of_the_derivatives(name):
    session = run(2, name)
    record = session.step()
    vertex, slot = int(record.vertices[0]), 0
    trial = session.trial(vertex, 2)
    H, g, sizes = np.zeros((3, 3)), np.zeros(3), np.zeros(3)
    for face in session.scene.mesh.one_rings[vertex].tolist():
        cells = face_cells(session, face, 2, vertex=vertex)
        if cells.derivatives is None:
            continue
        D, w = cells.derivatives.of_residuals.astype(float), cells.pair_weight[:, None] * cells.weights.astype(float)
        H += np.einsum("np,anp,bnp->ab", w, D, D)
        g += np.einsum("np,anp,np->a", w, D, cells.residual.astype(float))
        sizes += np.einsum("np,anp,np->a", w, np.abs(D), np.abs(cells.residual.astype(float)))
    rounding = of_sum(3 * 8256)  # the kernel sums in float32
    assert np.abs(H - trial.proposal.hessians[slot]).max() < rounding * np.trace(H)
    prior = linearised_sum(trial.sweep.terms, session.trace.vertices_at(2)).gradient[vertex]
    assert (np.abs(trial.proposal.gradients[slot] - g - prior) < rounding * sizes).all()


def test_limits_only_shorten_a_step_and_the_last_one_is_recorded():
    session = run(12)
    for moment, record in enumerate(session.trace.steps):
        if record.stage is not StageKind.PHOTOS:
            continue
        trial = session.trial(int(record.vertices[0]), moment)
        steps = [trial.proposal.proposed, trial.proposal.shortened, trial.proposal.tried]
        lengths = [np.linalg.norm(step, axis=1) for step in steps]
        assert (lengths[1] <= lengths[0] * (1 + 1e-12)).all()
        assert (lengths[2] <= lengths[1] * (1 + 1e-12)).all()
        moved = (record.after != record.before).any(axis=1)
        assert np.allclose((record.before + steps[2])[moved], record.after[moved], rtol=0, atol=0)


def test_a_vertex_of_another_block_is_tried_as_if_its_turn_came():
    session = Session(corner_scene(), small_options(schedule={"order": "sequential"}))
    session.step()
    following = set(session.sweep_state().blocks[session.position.block].vertices.tolist())
    other = next(int(b.vertices[0]) for b in session.sweep_state().blocks if int(b.vertices[0]) not in following)
    trial = session.trial(other)
    assert not trial.is_next
    assert trial.block.vertices.tolist() == [other]
    assert not trial.proposal.rejections.any()


def test_a_locked_vertex_has_no_trial_and_an_unknown_one_is_refused():
    session = Session(corner_scene(), small_options(locked_vertices=(1,)))
    session.step()
    assert session.trial(1) is None
    with pytest.raises(IndexError, match="this mesh has vertices"):
        session.trial(10_000)
