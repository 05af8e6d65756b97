"""Local searches: a position found fits better by the photos that see it there, and it is the true one."""

from dataclasses import dataclass

import numpy as np
import pytest

import fairing.run.search_step
from fairing.cells.context import CellContext
from fairing.run.local_search import SearchResult, search_directions
from fairing.run.phases import MAX_DISPLACEMENT
from fairing.run.session import Session
from fairing.scene import Scene
from fairing.trace import StepReason, StepRecord, Trace
from tests.search_scene import SHARP_AT_LAST, rough_scene, searching
from tests.small_scene import VERTICES, corner_scene

SEARCH_REASONS = {StepReason.FOUND_PLACE, StepReason.NO_BETTER_PLACE, StepReason.REJECTED_FOLD}
FAR = (0.2, -0.15, 0.15)  # 17 px at 60 px an edge, where blurs of 1.2 and 0.6 px see no slope towards the truth
OTHERS = (1, 2, 3, 4, 5, 6)


def is_search(record: StepRecord) -> bool:
    return record.position.sweep == 0


def pixels_moved(scene: Scene, place: np.ndarray, offset: np.ndarray) -> float:
    """The longest displacement in a photo, px, by central projection alone."""
    uv = [view.camera.project(np.array([place, place + offset]))[0] for view in scene.views]
    return max(float(np.linalg.norm(b - a)) for a, b in uv)


@dataclass
class Call:
    """One search of a block: its arguments and its result."""

    args: tuple
    found: SearchResult


@pytest.fixture
def calls(monkeypatch) -> list[Call]:
    seen = []
    search = fairing.run.search_step.search_block

    def spy(*args):
        found = search(*args)
        seen.append(Call(args, found))
        return found

    monkeypatch.setattr(fairing.run.search_step, "search_block", spy)
    return seen


def slow_score(vertex: int, places: np.ndarray, context: CellContext, energy: np.ndarray, scene: Scene, mean: float):
    """Mean loss per photo px of the faces around a vertex, one face at a time.

    Args:
        energy: (m,) float, of all faces.
        mean: the loss of a face that fewer than three photos see.
    """
    data = context.kernel
    seen, unseen = [], []
    for f in np.flatnonzero((scene.mesh.faces == vertex).any(axis=1)):
        a, b, c = places[scene.mesh.faces[f]]
        surface = np.linalg.norm(np.cross(b - a, c - a))
        k, pairs = data.face_dimensions[f], range(data.pair_start[f], data.pair_start[f + 1])
        if k == 0:
            unseen.append(surface)
            continue
        grid = data.face_grid[f]
        samples = data.grid_start[grid + 1] - data.grid_start[grid]
        pixels = sum(data.pair_weight[p] * samples for p in pairs)
        seen.append((energy[f] / pixels * len(pairs) / (len(pairs) - k), context.footprint_area[f], surface))
    if not seen:
        return mean
    density = sum(area for _, area, _ in seen) / sum(surface for *_, surface in seen)
    weights = [area for _, area, _ in seen] + [surface * density / 2 for surface in unseen]
    return float(np.average([loss for loss, *_ in seen] + [mean] * len(unseen), weights=weights))


@pytest.mark.parametrize("changes", [{}, SHARP_AT_LAST])
def test_a_position_found_fits_better_by_the_photos_that_see_it_there(calls, changes):
    scene = rough_scene()
    session = Session(scene, searching(10.0, **changes))
    session.run()
    taken = 0
    for call in calls:
        problem, block, vertices, _, context_at, _, scale, mean, _ = call.args
        after = vertices.copy()
        after[block.vertices] = call.found.after
        scores = []
        for places in (vertices, after):
            context = context_at(places, np.ones(len(scene.mesh.faces), dtype=bool))
            energy = problem.evaluator.measure(context, places, np.arange(len(scene.mesh.faces)), scale).energy
            scores.append([slow_score(v, places, context, energy, scene, mean) for v in block.vertices])
        before, now = np.array(scores)
        moved = (call.found.after != vertices[block.vertices]).any(axis=1)
        assert call.found.score_before == pytest.approx(before, rel=1e-6)
        assert (now[moved] < before[moved] * (1 - problem.options.schedule.search_gain) * (1 + 1e-6)).all(), (
            before,
            now,
        )
        taken += int(moved.sum())
    assert taken >= 3


def test_only_steps_of_a_search_have_its_reasons():
    session = Session(rough_scene(), searching(10.0))
    session.run()
    searches = [record for record in session.trace.steps if is_search(record)]
    assert {record.position.level for record in searches} == {0, 1}
    reasons = [StepReason(int(reason)) for record in searches for reason in record.reasons]
    assert set(reasons) <= SEARCH_REASONS
    assert StepReason.FOUND_PLACE in reasons
    assert StepReason.NO_BETTER_PLACE in reasons
    for record in searches:
        moved = (record.before != record.after).any(axis=1)
        assert np.array_equal(moved, record.reasons == StepReason.FOUND_PLACE)
        assert record.view_energy_before.sum() == pytest.approx(record.energy_before)
        assert record.view_energy_after.sum() == pytest.approx(record.energy_after)
        kept = ~np.isin(session.scene.mesh.faces[record.faces], record.vertices[moved]).any(axis=1)
        assert np.array_equal(record.face_energy_after[kept], record.face_energy_before[kept])
        faces = [set(np.flatnonzero((session.scene.mesh.faces == v).any(axis=1))) for v in record.vertices]
        assert sum(map(len, faces)) == len(set().union(*faces)), "vertices of a search share no face"
    for record in session.trace.steps:
        if not is_search(record):
            assert not np.isin(record.reasons, [StepReason.FOUND_PLACE, StepReason.NO_BETTER_PLACE]).any()


def test_a_search_finds_what_is_outside_the_basin_of_gauss_newton():
    scene = corner_scene(FAR)
    with_search, without = (Session(scene, searching(error, locked_vertices=OTHERS)) for error in (20.0, 0.0))
    with_search.run()
    without.run()
    errors = [float(np.linalg.norm(session.vertices[0] - VERTICES[0])) for session in (with_search, without)]
    assert errors[0] < 0.003, f"searched: {100 * errors[0]:.3f} % of the edge"
    assert errors[1] > 0.05, f"without a search: {100 * errors[1]:.3f} % of the edge"


def test_a_start_error_of_zero_disables_the_search():
    session = Session(rough_scene(), searching(0.0))
    session.run()
    assert not any(set(record.reasons.tolist()) & {8, 9} for record in session.trace.steps)


@pytest.mark.parametrize("changes", [{}, SHARP_AT_LAST])
def test_a_start_error_has_no_effect_without_a_search(changes):
    schedule = {"search": [0.0], "max_sweeps": [1]}
    sessions = [Session(rough_scene(), searching(error, schedule=schedule, **changes)) for error in (4.0, 0.0)]
    for session in sessions:
        session.run()
    assert np.array_equal(sessions[0].vertices, sessions[1].vertices)


def test_the_estimated_error_of_the_truth_is_zero():
    assert Session(corner_scene((0, 0, 0)), searching(-1.0)).make_plan().start_error == 0


@pytest.mark.parametrize("displacement", [(0.06, -0.04, 0.05), (0.12, -0.1, 0.1)])
def test_the_estimated_error_is_the_distance_in_the_photos(displacement):
    scene = corner_scene(displacement)
    estimate = Session(scene, searching(-1.0, locked_vertices=OTHERS)).make_plan().start_error
    distance = pixels_moved(scene, VERTICES[0], np.array(displacement))
    assert estimate == pytest.approx(distance, rel=0.2)


def test_a_start_near_its_truth_gets_few_sweeps_at_fine_levels():
    schedule = {
        "blur": [1.5, 1.2, 0.6], "search": [1.0, 0.8, 0.5], "first_level": "auto", "max_sweeps": [4], "sweep_tolerance": 0.0,
        "max_iterations": [1], "sweeps_near_truth": [1, 1, 2],
    }  # fmt: skip

    def sweeps(start_error: float) -> list[tuple[int, int]]:
        session = Session(corner_scene((0, 0, 0)), searching(start_error, schedule=schedule))
        session.run()
        return sorted({record.position[:2] for record in session.trace.steps if len(record.vertices)})

    assert sweeps(-1.0) == [(1, 0), (2, 0), (2, 1)]
    # With a given start error nothing is estimated.
    assert sweeps(0.0) == [(level, sweep) for level in range(3) for sweep in range(4)]


def test_no_vertex_ends_beyond_the_largest_displacement():
    """The true position of the corner is 17 px away; a displacement of 6 px is allowed."""
    scene = corner_scene(FAR)
    session = Session(scene, searching(4.0, locked_vertices=OTHERS))
    session.run()
    # A displacement in space is bounded as if it were seen where it looks longest; perspective adds some per cent.
    for moment in range(len(session.trace) + 1):
        offset = session.trace.vertices_at(moment)[0] - session.trace.start[0]
        assert pixels_moved(scene, session.trace.start[0], offset) < 1.1 * MAX_DISPLACEMENT * 4.0


@pytest.mark.slow
def test_a_run_resumed_within_a_search_writes_the_same_bytes(tmp_path):
    options = searching(10.0, schedule={"max_sweeps": [1], "max_iterations": [2]})
    whole = Session(rough_scene(), options)
    whole.trace.attach(tmp_path / "whole.trace")
    whole.run()
    whole.trace.detach()
    within = [m for m, record in enumerate(whole.trace.steps, 1) if is_search(record) and record.next_position.block]
    assert len(within) >= 2
    for stop in (within[0], within[-1]):
        session = Session(rough_scene(), options)
        session.trace.attach(tmp_path / "run.trace")
        for _ in range(stop):
            session.step()
        session.trace.detach()
        resumed = Session(rough_scene(), trace=Trace.load(tmp_path / "run.trace"))
        assert resumed.position.sweep == 0
        resumed.trace.attach(tmp_path / "run.trace")
        resumed.run()
        resumed.trace.detach()
        assert (tmp_path / "run.trace").read_bytes() == (tmp_path / "whole.trace").read_bytes()


@pytest.mark.slow
def test_the_number_of_threads_does_not_change_what_a_search_finds():
    schedule = {"max_sweeps": [1], "max_iterations": [1]}
    sessions = [Session(rough_scene(), searching(-1.0, threads=n, schedule=schedule, **SHARP_AT_LAST)) for n in (1, 2)]
    for session in sessions:
        session.run()
    assert sessions[0].plan == sessions[1].plan
    assert sessions[0].make_plan().start_error > 0
    assert np.array_equal(sessions[0].vertices, sessions[1].vertices)


def test_directions_are_the_diagonals():
    directions = search_directions()
    assert directions.shape == (8, 3)
    assert np.allclose(np.linalg.norm(directions, axis=1), 1)
    assert len(np.unique(np.sign(directions), axis=0)) == 8
