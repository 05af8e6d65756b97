"""Manual edits are steps of the record: they replay, resume, and set the origin of their vertices."""

import numpy as np
import pytest

from fairing.errors import InputError
from fairing.options import FairingOptions
from fairing.run.history import History
from fairing.run.manual_edits import with_locks
from fairing.run.phases import schedule_of
from fairing.run.session import Session
from fairing.scene import Scene
from fairing.trace import StepReason, Trace
from tests.small_scene import START, VERTICES, corner_scene, small_options

ORDERS = ("joint", "independent", "sequential")
CORNER = np.array([0])


def quick(order: str = "joint", **changes) -> FairingOptions:
    schedule = {"order": order, "max_sweeps": [2], "max_iterations": [2], "blur": [2.0, 0.8]}
    return small_options(schedule=schedule, **changes)


def session_after(steps: int, options: FairingOptions | None = None) -> Session:
    session = Session(corner_scene(), options or quick())
    for _ in range(steps):
        session.step()
    return session


def shifted(session: Session, by: tuple[float, float, float]) -> np.ndarray:
    return session.vertices[CORNER] + np.array(by)


def origin_at(session: Session, moment: int) -> np.ndarray:
    """(n, 3) float: where the engine began to move each vertex of a planned run."""
    assert session.plan is not None
    return History(session.trace, schedule_of(session.options, session.plan)).origin_at(moment)


def written(session: Session, folder) -> bytes:
    session.trace.attach(folder / "run.trace")
    session.trace.detach()
    return (folder / "run.trace").read_bytes()


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("steps", [0, 1, 3])
def test_a_manual_move_is_a_step_that_can_be_stepped_over(order, steps):
    session = session_after(steps, quick(order))
    before, target = session.vertices, shifted(session, (0.03, 0.02, -0.04))
    record = session.place(CORNER, target)
    assert record.is_manual
    assert record.reasons.tolist() == [StepReason.MOVED_MANUALLY]
    assert session.moment == len(session.trace) == steps + 1
    assert np.array_equal(session.vertices[CORNER], target)
    session.run()
    session.go_to(steps)
    assert np.array_equal(session.vertices, before)
    assert session.step() is record
    assert np.array_equal(session.vertices[CORNER], target)


@pytest.mark.parametrize("order", ORDERS)
def test_a_run_with_manual_moves_resumes_to_the_same_bytes(order, tmp_path):
    straight = session_after(2, quick(order))
    straight.place(CORNER, shifted(straight, (0.03, 0.02, -0.04)))
    for _ in range(3):
        straight.step()
    straight.reset(np.array([0, 3]))
    stopped = Session(corner_scene(), trace=Trace.load(_file_of(straight, tmp_path)))
    straight.run()
    stopped.run()
    assert written(straight, tmp_path) == written(stopped, tmp_path)


def _file_of(session: Session, folder):
    written(session, folder)
    return folder / "run.trace"


def test_a_manual_move_records_its_energies():
    session = session_after(0, quick(locked_vertices=(1, 2, 3, 4, 5, 6)))
    better = session.place(CORNER, VERTICES[CORNER])
    assert better.energy_after < 0.7 * better.energy_before
    assert better.faces.tolist() == [0, 1, 2, 3, 4, 5]
    assert better.step_px[0] > 2
    worse = session.place(CORNER, VERTICES[CORNER] + START)
    assert worse.energy_after > 1.4 * worse.energy_before
    assert (worse.eigenvalues[0] > 0).all()


def test_a_run_continues_from_a_manual_position():
    """From a position nearer than the start it ends where any run ends."""
    session = session_after(0, quick(locked_vertices=(1, 2, 3, 4, 5, 6)))
    session.place(CORNER, VERTICES[CORNER] + 0.01)
    session.run()
    assert session.finished
    assert np.linalg.norm(session.vertices[0] - VERTICES[0]) < 0.004


def test_a_finished_run_continues_at_its_last_level_after_a_manual_move():
    session = session_after(0, quick(locked_vertices=(1, 2, 3, 4, 5, 6)))
    session.run()
    end = session.vertices
    session.place(CORNER, shifted(session, (0.01, 0.0, -0.01)))
    assert not session.finished
    assert session.position.level == session.options.n_levels - 1
    assert session.trace.steps[-1].position.level == session.options.n_levels - 1
    session.run()
    assert session.finished
    assert np.abs(session.vertices - end).max() < 2e-3


def test_a_run_that_ends_with_a_higher_energy_returns_to_the_manual_positions(monkeypatch: pytest.MonkeyPatch):
    """If no step lowers the energy, the run ends at the manual positions, not at the start."""
    session = session_after(1, quick())
    session.place(CORNER, VERTICES[CORNER])
    left = session.vertices
    evaluator = session._problem.evaluator
    energies = evaluator.energies

    def worse_here(context, vertices, faces, sigma):
        system = energies(context, vertices, faces, sigma)
        system.energy[:] += 0.0 if np.array_equal(vertices, left) else 1e9
        return system

    monkeypatch.setattr(evaluator, "energies", worse_here)
    session.run()
    assert np.array_equal(session.vertices, left)
    assert "after the last manual edit" in session.stop_reason


def test_reset_puts_vertices_back_to_their_start():
    session = session_after(4)
    assert (session.vertices != session.trace.start).any(axis=1).sum() > 3
    record = session.reset(np.array([0, 2]))
    assert record.reasons.tolist() == [StepReason.RESET_MANUALLY] * 2
    assert np.array_equal(session.vertices[[0, 2]], session.trace.start[[0, 2]])
    assert np.array_equal(origin_at(session, session.moment), session.trace.start)


def test_the_origin_of_a_vertex_is_its_last_manual_position():
    session = session_after(1)
    first, second = shifted(session, (0.01, 0, 0)), shifted(session, (0, 0.01, 0))
    session.place(CORNER, first)
    session.step()
    session.place(CORNER, second)
    origins = [origin_at(session, moment)[0] for moment in range(5)]
    expected = [session.trace.start[0], session.trace.start[0], first[0], first[0], second[0]]
    assert np.array_equal(origins[:5], expected)
    assert np.array_equal(origin_at(session, 4)[1:], session.trace.start[1:])


@pytest.mark.parametrize("target", [(-0.5, -0.5, -0.5), (0.0, 0.5, 1.0)])
def test_a_move_that_turns_over_or_collapses_a_face_is_refused(target):
    """Through the opposite side of the cube; onto the line between two neighbours."""
    session = session_after(1)
    before = session.vertices
    with pytest.raises(InputError, match=r"face \d.*turned over or collapsed; nothing was moved"):
        session.place(CORNER, np.array([target]))
    assert len(session.trace) == session.moment == 1
    assert np.array_equal(session.vertices, before)


def test_a_move_behind_a_camera_is_refused():
    session = session_after(1)
    with pytest.raises(InputError, match="behind a camera"):
        session.place(CORNER, np.array([[9.0, 9.0, 9.0]]))
    with pytest.raises(InputError, match="finite"):
        session.place(CORNER, np.array([[np.nan, 1.0, 1.0]]))
    assert len(session.trace) == 1


def test_a_locked_vertex_cannot_be_moved_manually():
    session = session_after(0, quick(locked_vertices=(3,)))
    with pytest.raises(InputError, match="vertex 3: is locked"):
        session.place(np.array([0, 3]), session.vertices[[0, 3]] + 0.01)
    assert len(session.trace) == 0


def test_locks_are_options_in_the_numbers_of_the_input():
    scene = corner_scene()
    options = with_locks(quick(locked_vertices=(2,)), scene, np.array([0, 5]), locked=True)
    assert options.locked_vertices == (0, 2, 5)
    assert with_locks(options, scene, np.array([2, 5]), locked=False).locked_vertices == (0,)


def test_all_copies_of_a_welded_vertex_are_locked():
    plain = corner_scene()
    split = plain.mesh.vertices[plain.mesh.faces].reshape(-1, 3)  # every face with corners of its own
    scene = Scene.build("split", split, np.arange(len(split)).reshape(-1, 3), plain.views, points_choice="given")
    middle = int(np.argmin(np.linalg.norm(scene.mesh.vertices - plain.mesh.vertices[0], axis=1)))
    options = with_locks(quick(), scene, np.array([middle]), locked=True)
    assert options.locked_vertices == tuple(3 * face for face in range(6))
    assert np.flatnonzero(Session(scene, options).locked).tolist() == [middle]


def test_a_branch_with_other_locks_goes_on():
    session = session_after(3)
    branch = session.branch(with_locks(session.options, session.scene, CORNER, locked=True))
    held = branch.vertices[0]
    branch.run()
    assert branch.finished
    assert np.array_equal(branch.vertices[0], held)
