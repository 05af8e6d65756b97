"""The file of a run: complete, compact, and readable after any crash."""

import json
import resource
from dataclasses import fields

import numpy as np
import pytest

from fairing.errors import InputError
from fairing.run.session import Session
from fairing.trace import KEYFRAME_EVERY, MAGIC, StepRecord, Trace
from tests.small_scene import corner_scene, small_options


@pytest.fixture(scope="module")
def trace() -> Trace:
    """Some dozen steps, more than a keyframe's worth."""
    session = Session(corner_scene(), small_options(schedule={"order": "sequential", "max_iterations": [4]}))
    while len(session.trace) < KEYFRAME_EVERY + 10:
        session.step()
    return session.trace


def written(trace: Trace, path) -> bytes:
    trace.attach(path)
    trace.detach()
    return path.read_bytes()


def append_often(trace: Trace, record: StepRecord) -> None:
    """More than fits into any buffer."""
    for _ in range(100):
        trace.append(record)


def assert_same(one: StepRecord, other: StepRecord) -> None:
    for field in fields(StepRecord):
        a, b = getattr(one, field.name), getattr(other, field.name)
        assert np.array_equal(a, b), field.name
        if isinstance(a, np.ndarray):
            assert a.dtype == b.dtype, field.name


def test_a_loaded_trace_is_the_written_one(trace, tmp_path):
    written(trace, tmp_path / "run.trace")
    loaded = Trace.load(tmp_path / "run.trace")
    assert loaded.header == json.loads(json.dumps(trace.header))  # tuples become lists
    assert np.array_equal(loaded.start, trace.start)
    assert np.array_equal(loaded.faces, trace.faces)
    for one, other in zip(loaded.steps, trace.steps, strict=True):
        assert_same(one, other)
    assert len(Trace.load(str(tmp_path / "run.trace"))) == len(trace)


def test_positions_at_every_moment_follow_from_the_steps(trace):
    vertices = trace.start.copy()
    for moment, record in enumerate(trace.steps):
        assert np.array_equal(trace.vertices_at(moment), vertices)
        vertices[record.vertices] = record.after
    assert np.array_equal(trace.vertices_at(len(trace)), vertices)
    with pytest.raises(IndexError):
        trace.vertices_at(len(trace) + 1)


def test_positions_are_copies(trace):
    trace.vertices_at(3)[:] = 0
    trace.vertices_at(len(trace))[:] = 0
    assert trace.vertices_at(3).any()
    assert trace.vertices_at(len(trace)).any()


def test_a_file_cut_off_anywhere_loads_what_is_whole(trace, tmp_path):
    """Within the last step each 17th byte, before it each 151st."""
    short = trace.cut(3)
    data = written(short, tmp_path / "run.trace")
    last = len(written(trace.cut(2), tmp_path / "shorter.trace"))
    loaded_steps = set()
    path = tmp_path / "cut.trace"
    for length in [*range(0, last, 151), *range(last, len(data), 17), len(data) - 1]:
        path.write_bytes(data[:length])
        try:
            loaded = Trace.load(path)
        except InputError:
            assert not loaded_steps, "a longer file cannot be worse"
            continue
        loaded_steps.add(len(loaded))
        for one, other in zip(loaded.steps, short.steps[: len(loaded)], strict=True):
            assert np.array_equal(one.after, other.after)
    assert loaded_steps == {0, 1, 2}


def test_a_damaged_step_ends_the_trace_before_it(trace, tmp_path):
    short = trace.cut(5)
    data = bytearray(written(short, tmp_path / "run.trace"))
    data[-20] ^= 255
    (tmp_path / "run.trace").write_bytes(data)
    assert len(Trace.load(tmp_path / "run.trace")) == 4


def test_zeros_at_the_end_are_no_steps(trace, tmp_path):
    data = written(trace.cut(3), tmp_path / "run.trace")
    (tmp_path / "run.trace").write_bytes(data + bytes(100))
    assert len(Trace.load(tmp_path / "run.trace")) == 3


def test_steps_reach_the_file_as_they_happen_and_after_a_reload(trace, tmp_path):
    session = Session(corner_scene(), small_options())
    session.trace.attach(tmp_path / "run.trace")
    for _ in range(3):
        session.step()
    session.trace.flush()
    assert len(Trace.load(tmp_path / "run.trace")) == 3
    session.trace.detach()
    resumed = Session(corner_scene(), trace=Trace.load(tmp_path / "run.trace"))
    resumed.trace.attach(tmp_path / "run.trace")
    resumed.step()
    resumed.trace.detach()
    assert len(Trace.load(tmp_path / "run.trace")) == 4
    assert not list(tmp_path.glob("*.part"))


def test_writing_twice_gives_the_same_bytes(trace, tmp_path):
    assert written(trace, tmp_path / "a.trace") == written(trace, tmp_path / "b.trace")


def test_what_is_no_trace_is_refused_in_one_line(tmp_path):
    path = tmp_path / "x.trace"
    with pytest.raises(InputError, match="cannot be read"):
        Trace.load(path)
    path.write_bytes(b"ply\n")
    with pytest.raises(InputError, match="expected an EigenFairing trace"):
        Trace.load(path)
    path.write_bytes(MAGIC + b"\x00" * 40)
    with pytest.raises(InputError, match="damaged"):
        Trace.load(path)


def test_a_folder_that_cannot_be_written_is_one_line(trace, tmp_path):
    with pytest.raises(InputError, match="could not be written"):
        trace.attach(tmp_path / "missing" / "run.trace")


def test_a_full_disk_is_one_line_and_loses_no_step(trace, tmp_path):
    path = tmp_path / "run.trace"
    growing = trace.cut(2)
    growing.attach(path)
    record = trace.steps[2]
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    # Python ignores the signal that goes with it, so that writing beyond the limit fails as on a full disk.
    resource.setrlimit(resource.RLIMIT_FSIZE, (path.stat().st_size + 1000, limits[1]))
    try:
        for _ in range(2):
            with pytest.raises(InputError, match=r"run\.trace: could not be written"):
                append_often(growing, record)
        with pytest.raises(InputError, match="could not be written"):
            growing.detach()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert 2 <= len(Trace.load(path)) < len(growing)
    growing.append(record)
    growing.detach()
    assert len(Trace.load(path)) == len(growing)
    assert not list(tmp_path.glob("*.part"))


def test_a_cut_is_independent_of_its_origin(trace):
    branch = trace.cut(4)
    branch.header["options"] = "other"
    assert len(branch) == 4
    assert np.array_equal(branch.vertices_at(4), trace.vertices_at(4))
    assert trace.header["options"] != "other"
