"""Robust least squares of geometric stages: losses, rows and iterations against central differences and dense solutions."""

import numpy as np
import pytest
import trimesh

from fairing.geometry.normals import face_normals
from fairing.optimize.iteration import OBJECTIVE_TOLERANCE, iterate, step_parts
from fairing.optimize.loss import GemanMcClure, Huber, Loss
from fairing.optimize.rows import Anchor, Rows, Term
from tests.dense_term import dense
from tests.fit_of_points import guard_of
from tests.square_loss import Square

LOSSES = (Square(), GemanMcClure(0.7), Huber(0.7))
STEP = 1e-6


def rows(n: int, count: int, loss: Loss, seed: int = 0) -> Rows:
    """Random residuals of three vertices each, some of them outliers; at positions that are not those of `begun`."""
    rng = np.random.default_rng(seed)
    ids = np.array([rng.permutation(n)[:3] for _ in range(count)])
    residuals = np.where(rng.random(count) < 0.3, 5.0, 0.5) * rng.standard_normal(count)
    return Rows(
        "points",
        ids,
        rng.standard_normal((count, 3, 3)),
        residuals,
        rng.standard_normal((n, 3)),
        rng.uniform(0.1, 2.0, count),
        loss,
    )


def anchor(n: int, strength: float = 0.5, seed: int = 0) -> Anchor:
    """Random places, with a random positive definite precision for each vertex."""
    rng = np.random.default_rng(seed + 100)
    roots = rng.standard_normal((n, 3, 3))
    precision = strength * (roots @ np.swapaxes(roots, 1, 2) + 0.1 * np.eye(3))
    return Anchor("start", precision, rng.standard_normal((n, 3)))


def unlimited(vertices: np.ndarray, ids: np.ndarray, steps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A guard that shortens nothing."""
    return steps, np.zeros(len(ids), dtype=bool)


def slope(term: Term, vertices: np.ndarray) -> np.ndarray:
    """(n, 3) float: gradient of a term's energy, by central differences."""
    result = np.zeros_like(vertices)
    for place in np.ndindex(*vertices.shape):
        move = np.zeros_like(vertices)
        move[place] = STEP
        result[place] = (term.total(vertices + move) - term.total(vertices - move)) / (2 * STEP)
    return result


@pytest.mark.parametrize("loss", LOSSES)
def test_the_weight_of_a_residual_is_the_slope_of_its_loss_over_it(loss: Loss):
    residuals = np.concatenate(
        [np.linspace(-6, 6, 101) + 0.013, [1e-3]]
    )  # none at the kink of Huber's second derivative
    slopes = (loss.value(residuals + STEP) - loss.value(residuals - STEP)) / (2 * STEP)
    np.testing.assert_allclose(loss.weight(residuals) * residuals, slopes, atol=1e-8)
    assert loss.value(np.zeros(1))[0] == 0
    assert loss.weight(np.zeros(1))[0] == 1
    assert loss.value(np.array([1e-3]))[0] == pytest.approx(0.5e-6, rel=1e-5)


@pytest.mark.parametrize("loss", LOSSES)
def test_a_loss_lies_below_the_parabola_of_its_weight(loss: Loss):
    """What reweighting rests on: rho(r) <= rho(q) + w(q) (r^2 - q^2) / 2."""
    r, q = (each.ravel() for each in np.meshgrid(np.linspace(-5, 5, 101), np.linspace(-5, 5, 103)))
    assert (loss.value(r) <= loss.value(q) + loss.weight(q) * (r**2 - q**2) / 2 + 1e-12).all()


def test_geman_mcclure_and_huber_reject_distant_residuals():
    assert GemanMcClure(2.0).weight(np.array([2.0]))[0] == 0.25
    assert GemanMcClure(2.0).value(np.array([1e6]))[0] == pytest.approx(2.0, rel=1e-6)  # s^2 / 2
    assert Huber(2.0).weight(np.array([-8.0]))[0] == 0.25
    assert Huber(2.0).value(np.array([-8.0]))[0] == 2.0 * (8.0 - 1.0)


@pytest.mark.parametrize("term", [*(rows(6, 15, loss) for loss in LOSSES), anchor(6)])
def test_the_normal_equations_of_a_term_are_those_of_a_slow_loop_and_of_differences(term: Term):
    vertices = np.random.default_rng(3).standard_normal((6, 3))
    linear, (H, g) = term.linearise(vertices), dense(term, vertices)
    np.testing.assert_allclose(linear.matrix.toarray(), H, atol=1e-12)
    np.testing.assert_allclose(linear.gradient.ravel(), g, atol=1e-12)
    np.testing.assert_allclose(linear.gradient, slope(term, vertices), atol=1e-7)
    own = term.hessians(vertices)
    for v in range(6):
        np.testing.assert_allclose(own[v], H[3 * v : 3 * v + 3, 3 * v : 3 * v + 3], atol=1e-12)


def test_the_energy_of_a_vertex_is_that_of_its_rows():
    term, vertices = rows(6, 15, GemanMcClure(0.7)), np.random.default_rng(4).standard_normal((6, 3))
    each = term.information * term.loss.value(term.residuals_at(vertices))
    found = term.by_vertex(vertices)
    for v in range(6):
        assert found[v] == pytest.approx(each[(term.ids == v).any(axis=1)].sum())
    assert found.sum() == pytest.approx(3 * term.total(vertices))
    held = anchor(6)
    assert held.by_vertex(vertices).sum() == pytest.approx(held.total(vertices))


@pytest.mark.parametrize("loss", LOSSES)
def test_the_parts_of_a_step_are_those_of_a_dense_solution_and_add_up_to_it(loss: Loss):
    n, ids = 8, np.array([0, 2, 3, 7])
    terms = (rows(n, 30, loss), rows(n, 10, Huber(0.2), 1), anchor(n))
    vertices = np.random.default_rng(5).standard_normal((n, 3))
    parts = step_parts(terms, vertices, ids)
    columns = (3 * ids[:, None] + np.arange(3)).ravel()
    systems = [dense(term, vertices) for term in terms]
    H = sum(H for H, _ in systems)[np.ix_(columns, columns)]
    for t, (_, g) in enumerate(systems):
        np.testing.assert_allclose(parts[ids, :, t].ravel(), np.linalg.solve(H, -g[columns]), atol=1e-10)
    whole = np.linalg.solve(H, -sum(g for _, g in systems)[columns])
    np.testing.assert_allclose(parts.sum(axis=-1)[ids].ravel(), whole, atol=1e-10)
    assert (np.delete(parts, ids, axis=0) == 0).all()
    np.testing.assert_allclose(iterate(terms, vertices, ids, unlimited).proposed.ravel(), whole, atol=1e-10)


def test_one_iteration_solves_a_problem_of_squares():
    n = 6
    terms, vertices, ids = (rows(n, 20, Square()), anchor(n)), np.zeros((n, 3)), np.arange(n)
    after = iterate(terms, vertices, ids, unlimited).after
    gradient = sum(term.linearise(after).gradient for term in terms)
    np.testing.assert_allclose(gradient, 0, atol=1e-9)
    assert np.abs(after).max() > 0.1


@pytest.mark.parametrize("loss", LOSSES[1:])
@pytest.mark.parametrize("seed", range(5))
def test_iterations_never_raise_the_objective_and_reach_a_stationary_place(loss: Loss, seed: int):
    n = 10
    terms, ids = (rows(n, 60, loss, seed), anchor(n, 0.3, seed)), np.arange(n)
    vertices = 2 * np.random.default_rng(seed).standard_normal((n, 3))
    objective = sum(term.total(vertices) for term in terms)
    for _ in range(300):
        done = iterate(terms, vertices, ids, unlimited)
        assert done.accepted
        assert done.objectives[0] == pytest.approx(objective, rel=1e-12)
        assert done.objectives[1] <= done.objectives[0] * (1 + OBJECTIVE_TOLERANCE)
        vertices, objective = done.after, done.objectives[1]
        assert objective == pytest.approx(sum(term.total(vertices) for term in terms), rel=1e-12)
    assert np.abs(sum(slope(term, vertices) for term in terms)).max() < 1e-4


def test_a_step_that_raises_the_objective_is_rejected_and_moves_nothing():
    n = 6
    terms, vertices, ids = (rows(n, 20, GemanMcClure(0.7)), anchor(n)), np.zeros((n, 3)), np.arange(n)

    def backwards(vertices: np.ndarray, ids: np.ndarray, steps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return -steps, np.zeros(len(ids), dtype=bool)

    done = iterate(terms, vertices, ids, backwards)
    assert not done.accepted
    assert done.objectives[1] > done.objectives[0]
    assert (done.after == vertices).all()


def test_nothing_moves_without_terms_rows_or_vertices():
    vertices, n = np.random.default_rng(6).standard_normal((6, 3)), 6
    empty = Rows(
        "points", np.zeros((0, 3), int), np.zeros((0, 3, 3)), np.zeros(0), vertices, np.zeros(0), GemanMcClure(1.0)
    )
    held = Anchor("start", np.tile(np.eye(3), (n, 1, 1)), vertices)
    for terms, ids in (((), np.arange(n)), ((empty, held), np.arange(n)), ((anchor(n),), np.zeros(0, int))):
        done = iterate(terms, vertices, ids, unlimited)
        assert (done.after == vertices).all()
        assert done.accepted


@pytest.mark.parametrize("seed", range(4))
def test_no_face_folds_in_an_iteration_under_the_guard_of_a_run(seed: int):
    sphere = trimesh.creation.icosphere(2)
    start, faces = np.asarray(sphere.vertices), np.asarray(sphere.faces)
    n, ids, guard = len(start), np.arange(len(start)), guard_of(start, faces)
    targets = start + 0.3 * np.random.default_rng(seed).standard_normal(start.shape)  # edges are 0.3 long
    terms = (rows(n, 300, GemanMcClure(0.7), seed), Anchor("start", np.tile(30 * np.eye(3), (n, 1, 1)), targets))
    free, vertices, shortened = iterate(terms, start, ids, unlimited).after, start, 0
    assert ((face_normals(start, faces) * face_normals(free, faces)).sum(axis=1) < 0).any(), "nothing to guard"
    for _ in range(6):
        before = face_normals(vertices, faces)
        done = iterate(terms, vertices, ids, guard)
        assert ((before * face_normals(done.after, faces)).sum(axis=1) > 0).all()
        assert done.objectives[1] <= done.objectives[0] * (1 + OBJECTIVE_TOLERANCE) or not done.accepted
        shortened += int(done.folds.sum())
        vertices = done.after
    assert shortened > 0
    assert not np.array_equal(vertices, start)


def test_what_depends_on_some_vertices_is_all_that_changes_when_they_move():
    term, rng = rows(9, 40, GemanMcClure(0.8)), np.random.default_rng(3)
    before, after = rng.standard_normal((2, 9, 3))
    ids = np.array([2, 5])
    moved = before.copy()
    moved[ids] = after[ids]
    near = term.around(ids)
    assert len(near.residuals) == sum(bool({2, 5} & set(corners)) for corners in term.ids.tolist())
    assert near.total(moved) - near.total(before) == pytest.approx(term.total(moved) - term.total(before))
    assert near.hessians(before)[ids] == pytest.approx(term.hessians(before)[ids])


def test_factors_of_vertices_scale_a_residual_by_how_much_each_moves_it():
    term = rows(6, 10, Huber(0.5))
    factors = np.arange(1.0, 7.0)
    for r, found in enumerate(term.scaled(factors).information):
        share = [np.linalg.norm(d) for d in term.derivatives[r]]
        mean = sum(s * factors[v] for s, v in zip(share, term.ids[r], strict=True)) / sum(share)
        assert found == pytest.approx(term.information[r] * mean)
