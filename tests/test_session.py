"""Runs: monotone, reversible, resumable, and independent of units, orders and thread counts."""

from dataclasses import replace

import numpy as np
import pytest

from fairing.errors import InputError
from fairing.geometry.normals import face_normals
from fairing.options import FairingOptions, options_to_dict
from fairing.run.session import Session
from fairing.stage_kind import StageKind
from fairing.trace import StepReason, Trace
from tests.small_scene import FACES, START, VERTICES, corner_scene, photos, small_options

ORDERS = ("joint", "independent", "sequential", "worst_first")
MOVED = (StepReason.ACCEPTED, StepReason.CONVERGED)


def finished(options: FairingOptions | None = None, **scene) -> Session:
    session = Session(corner_scene(**scene), options or small_options())
    session.run()
    return session


def quick(order: str = "joint", **changes) -> FairingOptions:
    schedule = {"order": order, "max_sweeps": [2], "max_iterations": [2], "blur": [2.0, 0.8]}
    return small_options(schedule=schedule, **changes)


def bytes_of(trace: Trace, folder) -> bytes:
    """The trace as a file, its header left out."""
    trace.header = {}
    trace.attach(folder / "bytes.trace")
    trace.detach()
    return (folder / "bytes.trace").read_bytes()


def test_the_corner_moves_to_its_place():
    """Photos of 160 x 120, 60 px an edge: 0.1 px are 0.2 % of the edge. The start is 9 % off."""
    session = finished(small_options(locked_vertices=(1, 2, 3, 4, 5, 6)))
    error = np.linalg.norm(session.vertices[0] - VERTICES[0])
    assert error < 0.003, f"{100 * error:.3f} % of the edge"
    assert session.stop_reason.startswith("finished")
    assert session.progress == 1


@pytest.mark.slow
def test_the_paper_s_preset_moves_the_corner_closer():
    session = finished(
        small_options("paper", locked_vertices=(1, 2, 3, 4, 5, 6), schedule={"max_sweeps": [3], "max_iterations": [10]})
    )
    # Steps 10 to 200 times too short: 90 of them gain 6 %, a full run two thirds.
    assert np.linalg.norm(session.vertices[0] - VERTICES[0]) < 0.96 * np.linalg.norm(START)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("preset", ["accurate", "paper"])
def test_accepted_steps_never_raise_the_energy(order, preset):
    session = finished(small_options(preset, schedule={"order": order, "max_sweeps": [2], "max_iterations": [3]}))
    accepted = 0
    for record in session.trace.steps:
        moved = np.isin(record.reasons, MOVED)
        if moved.all():
            assert record.objective_after <= record.objective_before * (1 + 1e-9)
            accepted += 1
        if not moved.any() and not (record.reasons == StepReason.RETURNED).any():
            assert np.array_equal(record.before, record.after)
            assert np.array_equal(record.face_energy_after, record.face_energy_before)
    assert accepted > 3


@pytest.mark.parametrize("order", ORDERS)
def test_steps_join_up(order):
    """Each step begins where the last one of its vertices ended; energies of faces carry over within a sweep."""
    session = finished(quick(order))
    vertices, energy, sweep = session.trace.start.copy(), {}, None
    for record in session.trace.steps:
        assert np.array_equal(record.before, vertices[record.vertices])
        vertices[record.vertices] = record.after
        if record.position[:2] != sweep:
            sweep, energy = record.position[:2], {}
        for face, before, after in zip(record.faces, record.face_energy_before, record.face_energy_after, strict=True):
            assert before == energy.get(face, before)
            energy[face] = after
    assert np.array_equal(vertices, session.vertices)


def test_no_face_flips_from_a_rough_start():
    session = finished(displacement=(0.25, -0.2, 0.2))
    normals = [face_normals(vertices, FACES) for vertices in (session.trace.start, session.vertices)]
    assert ((normals[0] * normals[1]).sum(axis=1) > 0).all()


def test_locked_vertices_do_not_move():
    session = finished(small_options(locked_vertices=(2, 5)))
    moved = (session.vertices != session.trace.start).any(axis=1)
    assert moved.tolist() == [True, True, False, True, True, False, True]
    assert np.flatnonzero(session.locked).tolist() == [2, 5]


def test_a_locked_boundary_leaves_the_inner_vertex_free():
    session = finished(small_options(lock_boundary=True))
    assert (session.vertices != session.trace.start).any(axis=1).tolist() == [True] + [False] * 6


@pytest.mark.parametrize("order", ORDERS)
def test_the_number_of_threads_changes_no_byte(order, tmp_path):
    one, two = (finished(quick(order, threads=n)) for n in (1, 2))
    assert bytes_of(one.trace, tmp_path) == bytes_of(two.trace, tmp_path)


@pytest.mark.parametrize(
    ("scale", "shift"), [(1000.0, (0, 0, 0)), (0.001, (0, 0, 0)), (1.0, (1e5, -1e5, 2e5)), (1000.0, (1e6, 0, 0))]
)
def test_the_unit_and_the_origin_of_the_world_do_not_matter(scale, shift):
    plain = finished(quick()).vertices
    other = (finished(quick(), scale=scale, shift=shift).vertices - np.asarray(shift)) / scale
    # float32 cells resolve 1e-5 px, that is 2e-7 edges, which steps of nearly flat directions magnify.
    assert np.abs(other - plain).max() < 2e-5


def test_the_order_of_photos_does_not_matter():
    plain = finished(quick()).vertices
    other = finished(quick(), order=[3, 1, 7, 0, 6, 2, 5, 4]).vertices
    assert np.abs(other - plain).max() < 2e-5


def test_the_order_of_faces_does_not_matter():
    plain = finished(quick()).vertices
    other = finished(quick(), face_order=[4, 2, 0, 5, 1, 3]).vertices
    assert np.abs(other - plain).max() < 2e-5


def test_gains_and_offsets_of_photos_hardly_matter():
    """Gains of up to 20 % and offsets of up to 12 grey levels."""
    rng = np.random.default_rng(5)
    soft = {i: (0.75 * photo.astype(float) + 25).astype(np.uint8) for i, photo in enumerate(photos())}
    other = {
        i: np.clip(photo * rng.uniform(0.8, 1.2) + rng.uniform(-12, 12), 0, 255).astype(np.uint8)
        for i, photo in soft.items()
    }
    options = small_options(locked_vertices=(1, 2, 3, 4, 5, 6))
    ends = [finished(options, change=change).vertices[0] for change in (soft, other)]
    assert np.linalg.norm(ends[0] - ends[1]) < 0.001


@pytest.mark.parametrize("order", ORDERS)
def test_a_resumed_run_writes_the_same_bytes(order, tmp_path):
    whole = finished(quick(order))
    for stop in (1, len(whole.trace) // 2, len(whole.trace) - 1):
        session = Session(corner_scene(), quick(order))
        for _ in range(stop):
            session.step()
        session.trace.attach(tmp_path / "run.trace")
        session.trace.detach()
        resumed = Session(corner_scene(), trace=Trace.load(tmp_path / "run.trace"))
        assert resumed.moment == stop
        resumed.run()
        assert bytes_of(resumed.trace, tmp_path) == bytes_of(whole.trace, tmp_path)


@pytest.mark.parametrize("order", ["joint", "sequential"])
def test_going_back_and_on_gives_the_same_steps(order):
    session = finished(quick(order))
    n, end = len(session.trace), session.vertices
    for moment in (n // 3, 0, n - 1):
        session.go_to(moment)
        assert np.array_equal(session.vertices, session.trace.vertices_at(moment))
        branch = session.branch()
        assert len(branch.trace) == moment
        branch.run()
        assert np.array_equal(branch.vertices, end)
        assert session.step() is session.trace.steps[moment]
        assert session.moment == moment + 1
    assert len(session.trace) == n


def test_looking_at_the_past_does_not_change_the_future(tmp_path):
    looker = Session(corner_scene(), quick("sequential"))
    for _ in range(20):
        looker.step()
        looker.sweep_state(0)
        looker.sweep_state(looker.moment // 2)
    plain = Session(corner_scene(), quick("sequential"))
    for _ in range(20):
        plain.step()
    assert bytes_of(looker.trace, tmp_path) == bytes_of(plain.trace, tmp_path)


def test_a_branch_goes_on_with_other_options():
    session = finished(quick())
    session.go_to(4)
    branch = session.branch(quick(locked_vertices=(0,)))
    branch.run()
    assert np.array_equal(branch.vertices[0], session.trace.vertices_at(4)[0])
    assert branch.trace.header["options"] == options_to_dict(quick(locked_vertices=(0,)))
    assert session.trace.header["options"] == options_to_dict(quick())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("before", "after"),
    [("joint", "sequential"), ("sequential", "joint"), ("worst_first", "independent"), ("independent", "independent")],
)
def test_a_branch_goes_on_under_another_order(before, after, tmp_path):
    """From any moment: under another order the sweep begins anew. A resumed branch does the same."""
    session = Session(corner_scene(), quick(before))
    for _ in range(20):
        session.step()
    end = len(session.trace)
    for moment in range(1, end + 1):
        session.go_to(moment)
        branch = session.branch(quick(after))
        if before == after:
            assert branch.position == session.position
        assert branch.position[:2] == session.position[:2]
        record = branch.step()
        assert record is not None or session.finished
    branch.trace.attach(tmp_path / "branch.trace")
    branch.trace.detach()
    resumed = Session(corner_scene(), trace=Trace.load(tmp_path / "branch.trace"))
    branch.run()
    resumed.run()
    assert bytes_of(resumed.trace, tmp_path) == bytes_of(branch.trace, tmp_path)


def test_a_branch_with_fewer_levels_or_other_locks_runs_to_its_end():
    session = finished(quick("independent"))
    for moment in range(1, len(session.trace) + 1, 3):
        session.go_to(moment)
        branch = session.branch(quick("independent", locked_vertices=(0, 3)))
        kept = branch.vertices[[0, 3]]
        branch.run()
        assert np.array_equal(branch.vertices[[0, 3]], kept)
        coarse = session.branch(small_options(schedule={"order": "joint", "blur": [2.0], "max_sweeps": [1]}))
        coarse.sweep_state()
        coarse.run()
        assert coarse.finished


def test_stepping_back_and_forth_uses_the_cached_sweeps():
    session = finished(quick("independent"))
    steps = session.trace.steps
    begins = [m for m, step in enumerate(steps) if step.stage is StageKind.PHOTOS and step.position[2:] == (0, 0)]
    moments = begins[-2:]
    states = [session.sweep_state(moment) for moment in moments]
    assert states[0] is not states[1]
    for moment, state in zip(moments, states, strict=True):
        assert session.sweep_state(moment) is state


def test_blocks_sweeps_and_levels_end_where_their_names_say():
    session = Session(corner_scene(), quick("sequential"))
    session.step_block()
    assert session.position[:3] == (0, 0, 1)
    session.step_sweep()
    assert session.position in {(0, 1, 0, 0), (1, 0, 0, 0)}
    session.step_level()
    assert session.position == (1, 0, 0, 0)
    session.run()
    assert session.finished
    assert session.step() is None


def test_a_run_can_be_stopped_between_any_two_steps():
    session = Session(corner_scene(), quick())
    seen = []
    reason = session.run(should_stop=lambda: len(seen) == 3, on_step=seen.append)
    assert reason == "stopped on request"
    assert session.trace.steps == seen
    assert session.moment == 3


def test_there_is_no_moment_beyond_the_last():
    session = Session(corner_scene(), quick())
    with pytest.raises(IndexError, match="moments 0 to 0"):
        session.go_to(1)


def test_a_trace_of_another_scene_is_refused():
    session = finished(quick())
    with pytest.raises(InputError, match="expected the photos and the mesh it was recorded on"):
        Session(corner_scene(order=[1, 0, 2, 3, 4, 5, 6, 7]), trace=session.trace)
    with pytest.raises(InputError, match="expected the photos and the mesh it was recorded on"):
        Session(corner_scene(face_order=[1, 0, 2, 3, 4, 5]), trace=session.trace)


def test_a_mesh_no_photo_sees_is_one_line():
    scene = corner_scene()
    mesh = scene.mesh.moved(scene.mesh.vertices + np.array([0, 0, 50.0]))
    with pytest.raises(InputError, match="found none"):
        Session(replace(scene, mesh=mesh), small_options()).run()


def test_locked_vertices_that_do_not_exist_are_one_line():
    with pytest.raises(InputError, match="expected numbers 0 to 6, found 7"):
        Session(corner_scene(), small_options(locked_vertices=(7,)))


def test_options_no_run_can_work_with_are_one_line():
    with pytest.raises(InputError, match=r"max_sweeps: expected at least 1, found 0"):
        Session(corner_scene(), small_options(schedule={"max_sweeps": [0]}))
    session = Session(corner_scene(), quick())
    with pytest.raises(InputError, match=r"threads: expected at least 0, found -1"):
        session.branch(quick(threads=-1))


def test_faces_turned_inside_out_are_faired_all_the_same():
    scene = corner_scene()
    turned = replace(scene.mesh, faces=scene.mesh.faces[:, ::-1])
    session = Session(replace(scene, mesh=turned), quick())
    session.run()
    assert any("point away" in warning for warning in session.warnings)
    assert np.abs(session.vertices - finished(quick()).vertices).max() < 1e-4


def test_a_vertex_at_rest_rests_until_its_sweep_ends():
    schedule = {"order": "independent", "max_sweeps": [2], "max_iterations": [9]}
    session = Session(corner_scene(), small_options(step={"max_rejections": 0}, schedule=schedule))
    session.run()
    resting: dict[tuple, set] = {}
    seen = 0
    for record in session.trace.steps:
        before = resting.setdefault(record.position[:3], set())
        now = {int(v) for v, why in zip(record.vertices, record.reasons, strict=True) if why == StepReason.RESTING}
        assert before <= now
        seen += len(before)
        before |= now
    assert seen > 0


def test_a_record_holds_eigenvalues_energies_and_reasons():
    session = finished(quick())
    record = session.trace.steps[0]
    assert record.eigenvalues.shape == (7, 3)
    assert (np.diff(record.eigenvalues, axis=1) >= 0).all()
    assert record.view_energy_before.shape == (8,)
    assert record.view_energy_before.sum() == pytest.approx(record.face_energy_before.sum())
    assert record.view_energy_after.sum() == pytest.approx(record.face_energy_after.sum())
    assert StepReason(int(record.reasons[0])).text
    J = [view.camera.J_image_wrt_point(record.before[0]) for view in session.scene.views]
    longest = max(np.linalg.norm(j @ (record.after - record.before)[0]) for j in J)
    assert record.step_px[0] == pytest.approx(longest)
