"""Pulls of the terms: against dense linear algebra, and against the steps that runs record."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from fairing.optimize.rows import Anchor, Rows, Term
from fairing.run.pulls import shares, shares_of_all
from fairing.run.session import Session
from fairing.run.sweep import SweepState
from fairing.run_plan import RunPlan
from fairing.terms.names import AXES, TERMS
from fairing.trace import StepReason
from tests.dense_term import dense
from tests.small_scene import FACES, VERTICES, corner_scene, on_the_faces, small_options, sparse_points

PLAN = RunPlan(0, is_smoothed=True, is_fitted_to_points=True, start_sigma=2.0)
FOLLOWING = replace(PLAN, is_smoothed=False, start_sigma=0.0, represents_surface=True)
ACTIVE = {"points": [0.3], "creases": [0.0, 1.0, 1.0], "smoothing": [0.1, 0.1, 0.0]}
SHORT = {"max_sweeps": [2], "max_iterations": [3]}
ORDERS = ["joint", "independent", "sequential", "worst_first"]
N = len(VERTICES)
SOLVED = {StepReason.ACCEPTED, StepReason.REJECTED_ENERGY, StepReason.CONVERGED, StepReason.REJECTED_FOLD}
# Parts may be larger than their sum, and systems are ill-conditioned in directions that little determines.
ROUNDING = 1e-7


@cache
def run_of(order: str, plan: RunPlan = PLAN, preset: str = "accurate", damped: bool = False) -> Session:
    """A finished run of a few sweeps with every term that the plan allows."""
    step = ACTIVE | ({"damping_always": True, "initial_damping": 0.2} if damped else {})
    options = small_options(preset, schedule=SHORT | {"order": order}, step=step)
    scene = replace(corner_scene(), sparse_points=sparse_points(np.repeat(on_the_faces(), 2, axis=0)))
    session = Session(scene, options)
    session.trace.record_plan(plan)
    session.run()
    return session


def face_systems(session: Session, sweep: SweepState, vertices: np.ndarray):
    return session._problem.linearise(sweep.context, vertices, sweep.scale)


def dense_terms(session: Session, moment: int) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Normal matrix (3n, 3n) and gradient (3n,) of each term, added up entry by entry."""
    sweep, vertices = session.sweep_state(moment), session.trace.vertices_at(moment)
    system = face_systems(session, sweep, vertices)
    H, g = {"photos": np.zeros((3 * N, 3 * N))}, {"photos": np.zeros(3 * N)}
    for f, face in enumerate(FACES):
        index = [3 * v + axis for v in face for axis in range(3)]
        for i in range(9):
            g["photos"][index[i]] += system.g[f, i]
            for j in range(9):
                H["photos"][index[i], index[j]] += system.H[f, i, j]
    for term in sweep.terms:
        H[term.name], g[term.name] = dense(term, vertices)
    return H, g


def damping_before(session: Session, moment: int, v: int) -> float | None:
    """Damping of a vertex's step after a moment, from the records alone; None where the vertex is at rest."""
    step, steps = session.options.step, session.trace.steps
    is_over = moment == len(steps) and session.trace.steps[-1].next_position.level >= session.options.n_levels
    if moment > 0 and not is_over and steps[moment - 1].next_position.iteration > 0:
        last = steps[moment - 1]
        slots = np.flatnonzero(last.vertices == v)
        if len(slots):
            return None if last.rejections[slots[0]] > step.max_rejections else float(last.damping_next[slots[0]])
    return step.initial_damping if step.damping_always else 0.0


def dense_parts(session: Session, moment: int) -> dict[str, np.ndarray]:
    """The part (n, 3) of each term, by numpy's dense solver."""
    H, g = dense_terms(session, moment)
    whole = np.sum(list(H.values()), axis=0)
    moving = np.unique(np.concatenate([block.vertices for block in session.sweep_state(moment).blocks]))
    blocks = {v: slice(3 * v, 3 * v + 3) for v in moving.tolist()}
    largest = {v: float(np.linalg.eigvalsh(whole[block, block])[-1]) for v, block in blocks.items()}
    parts = {name: np.zeros((N, 3)) for name in g}
    if session.options.schedule.order == "joint":
        damping = max(damping_before(session, moment, v) or 0.0 for v in blocks)
        for v, block in blocks.items():
            # The solver's own ridge, see `solve_jointly`.
            ridge = 1e-6 * largest[v] + 1e-9 * float(np.median(list(largest.values())))
            whole[block, block] += (damping * largest[v] + ridge) * np.eye(3)
        rows = np.concatenate([np.arange(block.start, block.stop) for block in blocks.values()])
        for name in g:
            parts[name][moving] = -np.linalg.solve(whole[np.ix_(rows, rows)], g[name][rows]).reshape(-1, 3)
        return parts
    for v, block in blocks.items():
        damping = damping_before(session, moment, v)
        if damping is not None:
            for name in g:
                damped = whole[block, block] + damping * largest[v] * np.eye(3)
                parts[name][v] = -np.linalg.solve(damped, g[name][block])
    return parts


def moments_of(session: Session, most: int = 12) -> list[int]:
    """First, last and some moments between them."""
    return np.unique(np.linspace(0, len(session.trace), most).astype(int)).tolist()


CASES = [
    *((order, PLAN, "accurate", False) for order in ORDERS),
    *((order, FOLLOWING, "accurate", True) for order in ORDERS),
    *((order, PLAN, "paper", False) for order in ("joint", "sequential")),
]


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case[0]}-{case[2]}-{'damped' if case[3] else 'plain'}")
def test_parts_are_those_of_a_dense_solver(case):
    session = run_of(*case)
    for moment in moments_of(session):
        expected = dense_parts(session, moment)
        longest = max(float(np.abs(part).max()) for part in expected.values())
        pulls = session.pulls(moment)
        assert [pull.name for pull in pulls] == list(expected)
        for pull in pulls:
            assert pull.step == pytest.approx(expected[pull.name], abs=ROUNDING * longest), (moment, pull.name)


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case[0]}-{case[2]}-{'damped' if case[3] else 'plain'}")
def test_parts_add_up_to_the_step_that_is_proposed_next(case):
    session, compared = run_of(*case), 0
    for moment, record in enumerate(session.trace.steps):
        if not set(record.reasons.tolist()) & SOLVED:
            continue
        pulls = session.pulls(moment)
        total = np.sum([pull.step for pull in pulls], axis=0)[record.vertices]
        longest = max(float(np.abs(pull.step).max()) for pull in pulls)
        assert total == pytest.approx(record.proposed, abs=ROUNDING * longest), moment
        compared += 1
    assert compared >= 4


def test_every_term_appears_under_its_name():
    names = {pull.name for moment in moments_of(run_of("joint")) for pull in run_of("joint").pulls(moment)}
    assert names == set(TERMS) - {AXES}, "which buildings alone have"
    for name in ("points", "image edges", "smoothness", "start"):
        session = run_of("joint")
        steps = [p.step for moment in moments_of(session) for p in session.pulls(moment) if p.name == name]
        assert max(float(np.abs(step).max()) for step in steps) > 0, name


@pytest.mark.parametrize("order", ORDERS)
def test_energies_are_what_a_vertex_s_own_system_minimizes(order):
    """The energy of the faces around it, and the quadratic form of each prior."""
    session = run_of(order)
    for moment in moments_of(session, 4):
        sweep, vertices = session.sweep_state(moment), session.trace.vertices_at(moment)
        faces, pulls = face_systems(session, sweep, vertices).energy, session.pulls(moment)
        for v in range(N):
            around = sum(faces[f] for f in range(len(FACES)) if v in FACES[f])
            assert pulls[0].energy[v] == pytest.approx(around)
        for pull, term in zip(pulls[1:], sweep.terms, strict=True):
            assert pull.energy == pytest.approx(energy_by_vertex(term, vertices))


def energy_by_vertex(term: Term, vertices: np.ndarray) -> np.ndarray:
    """(n,) float: the energy that each vertex shares in, one after the other."""
    if isinstance(term, Anchor):
        offsets = vertices - term.places
        return np.array([0.5 * offset @ B @ offset for offset, B in zip(offsets, term.precision, strict=True)])
    assert isinstance(term, Rows)
    energies = term.information * term.loss.value(term.residuals_at(vertices))
    return np.array([sum(e for e, ids in zip(energies, term.ids, strict=True) if v in ids) for v in range(N)])


@pytest.mark.parametrize("order", ORDERS)
def test_shares_are_those_of_the_information_along_the_step(order):
    session = run_of(order)
    for moment in moments_of(session, 5):
        H, _ = dense_terms(session, moment)
        pulls = session.pulls(moment)
        steps, found = np.sum([pull.step for pull in pulls], axis=0), shares(pulls)
        summed = dict.fromkeys(H, 0.0)
        for v in range(N):
            block = slice(3 * v, 3 * v + 3)
            along = {name: steps[v] @ matrix[block, block] @ steps[v] for name, matrix in H.items()}
            summed = {name: summed[name] + along[name] for name in summed}
            for share, name in zip(found[:, v], along, strict=True):
                if steps[v].any():
                    assert share == pytest.approx(along[name] / sum(along.values()), abs=1e-9)
                else:
                    assert np.isnan(share)
        if steps.any():
            expected = [value / sum(summed.values()) for value in summed.values()]
            assert shares_of_all(pulls) == pytest.approx(expected, abs=1e-9)


def test_the_length_in_px_is_that_in_the_photo_where_a_step_is_longest():
    session = run_of("joint")
    vertices = session.trace.vertices_at(3)
    for pull in session.pulls(3):
        small = 1e-6 / max(1e-300, float(np.abs(pull.step).max()))  # to first order
        ends = [view.camera.project(vertices + small * pull.step)[0] for view in session.scene.views]
        begins = [view.camera.project(vertices)[0] for view in session.scene.views]
        moved = np.linalg.norm(np.array(ends) - begins, axis=2) / small
        seen = session.sweep_state(3).context.vertex_views
        assert pull.step_px == pytest.approx(np.where(seen, moved.T, 0).max(axis=1), rel=1e-4, abs=1e-9)
        assert pull.step_px == pytest.approx(session.pixels_moved(pull.step, 3))


def test_pulls_change_neither_the_run_nor_its_next_step():
    def fresh() -> Session:
        session = Session(run_of("joint").scene, run_of("joint").options)
        session.trace.record_plan(PLAN)
        return session

    asked, plain = fresh(), fresh()
    while not plain.finished:
        plain.step()
        asked.pulls()
        asked.step()
    assert asked.vertices.tobytes() == plain.vertices.tobytes()


def test_a_locked_vertex_has_no_step():
    session = Session(corner_scene(), small_options(locked_vertices=(0, 3)))
    for pull in session.pulls():
        assert not pull.step[[0, 3]].any()


@pytest.mark.parametrize("moment", [-1, 10_000])
def test_a_moment_that_is_not_recorded_is_refused(moment):
    with pytest.raises(IndexError, match="this run has moments 0 to"):
        run_of("joint").pulls(moment)
