"""Crafted traces and flip records: right checksums, wrong content. Each is refused in one clear line."""

import json
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fairing.errors import InputError
from fairing.run.session import Session
from fairing.stage_kind import StageKind
from fairing.trace import StepRecord, Trace
from fairing.triangulation import FlipTrace
from tests.record_files import flip, raw_block, run_header, split_round, step, write_flips, write_trace
from tests.small_scene import FACES, VERTICES, corner_scene


def header(**changes: Any) -> dict[str, Any]:
    values = run_header() | changes
    return {name: value for name, value in values.items() if value is not ...}


def options(**changes: Any) -> dict[str, Any]:
    values = run_header()
    return values | {"options": values["options"] | changes}


def refused(load: Any, path: Path, said: str) -> None:
    with pytest.raises(InputError, match=said) as error:
        load(path)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


def test_a_trace_of_version_1_loads(tmp_path: Path):
    trace = Trace.load(write_trace(tmp_path / "run.trace", steps=[step(), step(before=VERTICES[[0]] + 0.01)]))
    assert len(trace) == 2
    assert {field.name for field in fields(StepRecord)} == step().keys() | {"stage"}, (
        "which this version did not record"
    )
    assert trace.steps[0].stage is StageKind.PHOTOS
    np.testing.assert_array_equal(trace.vertices_at(1)[0], VERTICES[0] + 0.01)
    np.testing.assert_array_equal(trace.faces, FACES)
    assert trace.steps[0].position == (0, 0, 0, 0)
    assert trace.header == json.loads(json.dumps(header()))


def test_flips_of_version_1_load(tmp_path: Path):
    trace = FlipTrace.load(write_flips(tmp_path / "mesh.flips"))
    assert trace.faces_at(1)[:2].tolist() == [[1, 2, 3], [0, 1, 3]]  # (d, b, c) and (a, d, c)
    np.testing.assert_array_equal(trace.faces_at(1)[2:], FACES[2:])
    assert trace.splits == ()


def test_face_splits_load(tmp_path: Path):
    first = split_round()
    trace = FlipTrace.load(write_flips(tmp_path / "mesh.flips", splits=[first]))
    assert len(trace) == 1
    vertices, faces = trace.splits[0].result()
    np.testing.assert_array_equal(vertices, first["after"])
    new = {frozenset(face) for face in faces.tolist()} - {frozenset(face) for face in FACES.tolist()}
    middle = set(range(len(VERTICES), len(vertices)))
    assert middle in new, "the middle one of four"
    second = split_round(
        vertices=vertices, faces=faces, after=vertices, chosen=np.zeros(0, int), offsets=np.zeros(0), parts=np.zeros(0, int),
        judges=np.zeros(0, int), errors=np.zeros((0, 2)), significance=np.zeros(0), is_split=np.zeros(0, np.uint8),
    )  # fmt: skip
    path = write_flips(tmp_path / "mesh.flips", splits=[first, second])
    assert len(FlipTrace.load(path).splits) == 2
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) * 2 // 3])  # cut off within the second round
    cut = FlipTrace.load(path)
    assert (len(cut.splits), len(cut)) == (1, 0)
    refused(
        FlipTrace.load,
        write_flips(path, splits=[first, first]),
        "face splits, round 2: vertices: expected those after the round before",
    )


HEADERS = {
    "no JSON": ("{", "expected a header"),
    "a list": ("[]", "expected a header"),
    "nested": ("[" * 100_000, "expected a header"),
    "no scene": (header(scene=...), "header: expected the scene's name"),
    "scene a number": (header(scene=3), "header: expected the scene's name"),
    "no views": (header(views=...), "header: expected a list of photo names"),
    "views numbers": (header(views=[1, 2]), "header: expected a list of photo names"),
    "no options": (header(options=...), "header: expected the run's options"),
    "options a text": (header(options="fast"), "header: expected the run's options"),
    "unknown option": (options(speed=3), "options: unknown option speed"),
    "stage a number": (options(cells=3), "options.cells: expected options by name, found 3"),
    "option of another type": (options(threads="many"), "option threads: expected a value of type int, found 'many'"),
    "option NaN": (options(region=[float("nan")] * 6), "option region"),
    "tuple of texts": (options(locked_vertices=["a"]), "option locked_vertices: expected a value of type int"),
    "levels a number": (options(levels=3), "options.levels: expected a value such as"),
    "no levels": (options(levels=[]), "option schedule.blur: expected at least one value, found none"),
    "a level a number": (options(levels=[3]), "options.levels: expected options by name, found 3"),
    "unknown option of a level": (options(levels=[{"speed": 3}]), "options.levels: unknown option speed"),
    "a list in a level": (options(levels=[{"blur": [3]}]), "options.levels.blur: expected a value such as"),
    "a level's option of another type": (
        options(levels=[{"size": "a"}]),
        "option cells.size: expected a value of type int",
    ),
    "former list too small": (options(cells={"size": [64, 2]}), "option cells.size: expected at least 4, found 2"),
    "unknown choice": (options(robust={"norm": "l1"}), "option robust.norm: expected one of .*found 'l1'"),
    "bool a text": (options(lock_boundary="no"), "option lock_boundary: expected a value of type bool"),
    "points a number": (header(sparse_points=3), "header: expected count and digest of sparse_points"),
}


@pytest.mark.parametrize("what", HEADERS)
def test_a_crafted_header_is_refused(tmp_path: Path, what: str):
    value, said = HEADERS[what]
    refused(Trace.load, write_trace(tmp_path / "run.trace", value), said)


MESHES = {
    "no start": ({"start": ...}, "expected the field start"),
    "start of texts": ({"start": np.array([["a"] * 3])}, "expected numbers"),
    "start infinite": ({"start": np.full((7, 3), np.inf)}, "not finite"),
    "start huge": ({"start": np.full((7, 3), 1e200)}, "expected coordinates of at most 1e\\+100"),
    "start 2D": ({"start": VERTICES[:, :2]}, "start: expected floating-point numbers of shape"),
    "faces out of range": ({"faces": FACES + 3}, "face 2 uses vertices"),
    "faces negative": ({"faces": FACES - 1}, "uses vertices"),
    "faces as floats": ({"faces": FACES.astype(float)}, "faces: expected whole numbers"),
    "unknown": ({"extra": np.zeros(3)}, "expected no field extra"),
}


@pytest.mark.parametrize("what", MESHES)
def test_a_crafted_start_is_refused(tmp_path: Path, what: str):
    change, said = MESHES[what]
    refused(Trace.load, write_trace(tmp_path / "run.trace", **change), said)


STEPS = {
    "vertex negative": ({"vertices": np.array([-1])}, "vertices: expected ids of 0 to 6, found -1"),
    "vertex too large": ({"vertices": np.array([7])}, "vertices: expected ids of 0 to 6, found 7"),
    "vertex a float": ({"vertices": np.array([0.0])}, "vertices: expected whole numbers"),
    "vertex missing": ({"vertices": ...}, "expected the field vertices"),
    "face too large": ({"faces": np.arange(6) + 1}, "faces: expected ids of 0 to 5, found 6"),
    "reason unknown": ({"reasons": np.array([99], np.int8)}, "reasons: expected ids of 0 to 17, found 99"),
    "reason negative": ({"reasons": np.array([-1], np.int8)}, "reasons: expected ids of 0 to 17, found -1"),
    "position short": ({"position": np.array([0, 0])}, r"position: expected whole numbers of shape \(4,\)"),
    "position negative": ({"next_position": np.array([0, -1, 0, 0])}, "next_position: expected counts from 0, found -1"),
    "position absurd": ({"position": np.array([0, 0, 2**62, 0])}, "position: expected counts"),
    "position a text": ({"position": np.array(["a"] * 4)}, "expected numbers"),
    "sweep of the future": ({"sweep_moment": np.array(1)}, "sweep_moment: expected ids of 0 to 0, found 1"),
    "sweep negative": ({"sweep_moment": np.array(-1)}, "sweep_moment: expected ids of 0 to 0, found -1"),
    "sweep a list": ({"sweep_moment": np.array([0])}, "sweep_moment: expected whole numbers of shape"),
    "after NaN": ({"after": np.full((1, 3), np.nan)}, "after: expected finite"),
    "after huge": ({"after": np.full((1, 3), 1e155)}, "after: expected coordinates"),
    "after of two": ({"after": np.zeros((2, 3))}, r"after: expected floating-point numbers of shape \(1, 3\)"),
    "energy infinite": ({"face_energy_after": np.full(6, np.inf)}, "face_energy_after: expected finite"),
    "objective NaN": ({"objective_before": np.array(np.nan)}, "objective_before: expected finite"),
    "views of another scene": ({"view_energy_after": np.zeros(3)}, "view_energy_after: expected .*shape"),
    "rejections negative": ({"rejections": np.array([-1])}, "rejections: expected counts from 0"),
    "complex": ({"damping": np.array([1j])}, "expected numbers, found complex128"),
    "extra": ({"more": np.array(1)}, "expected no field more"),
}  # fmt: skip


@pytest.mark.parametrize("what", STEPS)
def test_a_crafted_step_is_refused(tmp_path: Path, what: str):
    change, said = STEPS[what]
    refused(Trace.load, write_trace(tmp_path / "run.trace", steps=[step(**change)]), f"step 1: .*{said}")


FLIPS = {
    "vertex": ({"edge": np.array([0, 7])}, "edge: expected ids of 0 to 6, found 7"),
    "negative": ({"opposite": np.array([-3, 1])}, "opposite: expected ids of 0 to 6, found -3"),
    "face": ({"faces": np.array([1, 6])}, "faces: expected ids of 0 to 5, found 6"),
    "other faces": ({"faces": np.array([1, 2])}, r"expected the faces \[1, 2\] beside the edge \(0, 2\)"),
    "energy": ({"energy": np.array([np.nan, 0])}, "energy: expected finite"),
    "no energy": ({"round_energy": ...}, "expected the field round_energy"),
    "views": ({"n_views": np.array(-1)}, "n_views: expected counts from 0"),
    "round": ({"round": np.array([0])}, "round: expected whole numbers of shape"),
}


@pytest.mark.parametrize("what", FLIPS)
def test_a_crafted_flip_is_refused(tmp_path: Path, what: str):
    change, said = FLIPS[what]
    refused(FlipTrace.load, write_flips(tmp_path / "mesh.flips", flips=[flip(**change)]), f"flip 1: .*{said}")


SPLITS = {
    "face": ({"chosen": np.array([6])}, "chosen: expected ids of 0 to 5, found 6"),
    "part": ({"parts": np.array([1])}, "parts: expected ids of 0 to 0, found 1"),
    "judgement": ({"is_split": np.array([2], np.uint8)}, "is_split: expected ids of 0 to 1, found 2"),
    "judges": ({"judges": np.array([-1])}, "judges: expected counts from 0"),
    "errors": ({"errors": np.array([[2.0, np.nan]])}, "errors: expected finite"),
    "offsets": ({"offsets": np.zeros(2)}, r"offsets: expected floating-point numbers of shape \(1,\)"),
    "too few vertices": ({"after": VERTICES}, "after: expected 10 vertices, one more for each divided edge, found 7"),
    "no place": ({"after": np.full((10, 3), np.nan)}, "after: expected coordinates|after: .*finite"),
    "mesh": ({"faces": FACES + 3}, "face 2 uses vertices"),
    "none": ({"chosen": ...}, "expected the field chosen"),
    "more": ({"extra": np.zeros(1)}, "expected no field extra"),
}


@pytest.mark.parametrize("what", SPLITS)
def test_a_crafted_face_split_is_refused(tmp_path: Path, what: str):
    change, said = SPLITS[what]
    path = write_flips(tmp_path / "mesh.flips", splits=[split_round(**change)])
    refused(FlipTrace.load, path, f"face splits, round 1: .*({said})")


@pytest.mark.parametrize("count", ["0", "-1", "x", "1.0", "²", "9" * 5000])
def test_a_number_of_face_splits_that_is_none_is_refused(tmp_path: Path, count: str):
    path = write_flips(tmp_path / "mesh.flips", splits=[split_round()], n_splits=count)
    refused(FlipTrace.load, path, "splits: expected the number of rounds, found")


@pytest.mark.parametrize("payload", [b"nonsense", b"PK\x05\x06" + bytes(18), b"PK\x03\x04" * 30])
@pytest.mark.parametrize(
    ("load", "magic"), [(Trace.load, b"EIGENFAIRING TRACE 1\n"), (FlipTrace.load, b"EIGENFAIRING FLIPS 1\n")]
)
def test_a_block_that_is_no_archive_is_refused(tmp_path: Path, load: Any, magic: bytes, payload: bytes):
    path = tmp_path / "record"
    path.write_bytes(magic + raw_block(payload))
    refused(load, path, "record")


def test_a_run_that_goes_on_at_a_block_its_sweep_does_not_have_is_refused(tmp_path: Path):
    path = write_trace(tmp_path / "run.trace", steps=[step(next_position=np.array([0, 0, 5, 0]))])
    session = Session(corner_scene(), trace=Trace.load(path))
    with pytest.raises(InputError, match="continues at block 6 of a sweep with"):
        session.step()


def test_a_run_that_goes_on_with_other_vertices_is_refused(tmp_path: Path):
    path = write_trace(tmp_path / "run.trace", steps=[step(vertices=np.array([3]))])
    session = Session(corner_scene(), trace=Trace.load(path))
    with pytest.raises(InputError, match="step 1 moved other vertices"):
        session.step()
