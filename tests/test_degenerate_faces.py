"""Faces without area and copies of vertices in a run: they change nothing for the vertices around them."""

import json
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.cli.main import run
from fairing import fair
from fairing.check.scene_check import check_scene
from fairing.errors import InputError
from fairing.geometry.normals import face_normals
from fairing.io import load_scene, read_mesh
from fairing.judge.report import run_report
from fairing.options import FairingOptions
from fairing.run.session import Session
from fairing.scene import Scene
from fairing.solve.locks import locked_by_options
from fairing.texture import textured_model
from tests.small_scene import FACES, START, VERTICES, corner_scene, observed, on_the_faces, small_options, write_corner

CORNER = VERTICES + np.vstack([START, np.zeros((6, 3))])
ON_EDGE = (CORNER[1] + 2 * CORNER[2]) / 3
DEGENERATE = {
    "a repeated corner": (np.zeros((0, 3)), [[0, 0, 1], [2, 2, 2], [3, 0, 3]]),
    "two copies of a corner": (CORNER[[0, 0]], [[7, 8, 1], [0, 7, 3]]),
    "corners on a line": ((CORNER[:1] + CORNER[1:2]) / 2, [[0, 7, 1], [1, 7, 0]]),
    "copies that differ by rounding": (CORNER[[0, 2]] + 1e-6, [[0, 7, 1], [2, 8, 0], [7, 0, 2]]),
}


def corner_with(vertices: np.ndarray, faces: list[list[int]], first: bool = False) -> Scene:
    """The corner with further vertices, and further faces after or before its own."""
    plain = corner_scene()
    added = np.array(faces)
    order = [added, FACES] if first else [FACES, added]
    return Scene.build("corner", np.vstack([CORNER, vertices]), np.vstack(order), plain.views)


def finished(scene: Scene, options: FairingOptions | None = None) -> Session:
    session = Session(scene, options or small_options())
    session.run()
    return session


@pytest.fixture(scope="module")
def plain() -> Session:
    return finished(corner_scene())


@pytest.mark.parametrize("first", [False, True])
@pytest.mark.parametrize("kind", sorted(DEGENERATE))
def test_a_face_without_area_changes_no_bit_of_the_result(plain, kind, first):
    session = finished(corner_with(*DEGENERATE[kind], first=first))
    assert not session.locked.any()
    np.testing.assert_array_equal(session.vertices[:7], plain.vertices)
    assert session.scene.original_faces.shape == (6 + len(DEGENERATE[kind][1]), 3)


def test_with_points_and_all_preparations_it_changes_nothing_either():
    points = observed(corner_scene(), on_the_faces()).sparse_points
    one, other = (
        fair(replace(scene, sparse_points=points, truth=None)).vertices
        for scene in (corner_scene(), corner_with(*DEGENERATE["a repeated corner"]))
    )
    np.testing.assert_array_equal(one, other)


def test_a_needle_is_protected_from_flips():
    """A corner of it lies beside the opposite edge, which moves by 50 times that distance."""
    middle = (CORNER[0] + CORNER[1]) / 2
    vertices = np.vstack([CORNER, middle + 1e-3 * (CORNER[2] - middle)])
    # The face 0 1 2 is split at that corner, and a needle remains between the corner and the edge 0 1.
    faces = np.vstack([[[0, 1, 7], [1, 2, 7], [2, 0, 7]], FACES[1:]])
    scene = Scene.build("needle", vertices, faces, corner_scene().views)
    session = finished(scene)
    assert len(scene.mesh.faces) == 8
    before, after = (face_normals(v, faces) for v in (session.trace.start, session.vertices))
    assert ((before * after).sum(axis=1) > 0).all()


def test_the_boundary_is_that_of_the_surface():
    """An edge meets two shorter ones of its neighbour, and a face without area between them closes the mesh."""
    middle = (CORNER[0] + CORNER[2]) / 2
    faces = np.vstack([FACES[:1], [[0, 7, 3], [7, 2, 3], [0, 2, 7]], FACES[2:]])
    scene = Scene.build("seam", np.vstack([CORNER, middle]), faces, corner_scene().views)
    assert len(scene.mesh.faces) == 7
    locked = locked_by_options(scene, small_options(lock_boundary=True))
    assert np.flatnonzero(locked).tolist() == [1, 2, 3, 4, 5, 6]


def write_strip(path: Path, vertices: np.ndarray, indices: list[int]) -> None:
    """A GLB with one triangle strip."""
    positions, order = vertices.astype("<f4").tobytes(), np.array(indices, "<u4").tobytes()
    low, high = vertices.astype("f4").min(axis=0).tolist(), vertices.astype("f4").max(axis=0).tolist()
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "mode": 5}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": len(vertices), "type": "VEC3", "min": low, "max": high},
            {"bufferView": 1, "componentType": 5125, "count": len(indices), "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": len(positions)},
            {"buffer": 0, "byteOffset": len(positions), "byteLength": len(order)},
        ],
        "buffers": [{"byteLength": len(positions) + len(order)}],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    data = positions + order
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)


def test_a_stitched_strip_is_refined(tmp_path: Path):
    """The six faces of the corner as one strip, as programs stitch them: by repeated vertices."""
    write_corner(tmp_path / "corner")
    strip = FACES[0].tolist()
    for a, b, c in FACES[1:].tolist():
        strip += [strip[-1], strip[-1], a, a, b, c]
    write_strip(tmp_path / "strip.glb", CORNER, strip)
    scene = load_scene(tmp_path / "corner", mesh=tmp_path / "strip.glb")
    assert len(scene.mesh.faces) == 6
    assert run(["fair", str(tmp_path / "corner"), "--mesh", str(tmp_path / "strip.glb"), "--out", str(tmp_path / "out"),
                "--points", "none"]) == 0  # fmt: skip
    vertices, faces = read_mesh(tmp_path / "out" / "mesh.ply")
    np.testing.assert_array_equal(faces, read_mesh(tmp_path / "strip.glb")[1])
    assert np.linalg.norm(vertices[0] - VERTICES[0]) < 0.1 * np.linalg.norm(START)


def test_all_faces_are_written_and_named_by_their_place_in_the_input(tmp_path: Path):
    write_corner(tmp_path / "corner")
    mesh = tmp_path / "corner" / "mesh.obj"
    lines = mesh.read_text().splitlines()
    at = next(i for i, line in enumerate(lines) if line.startswith("f"))
    mesh.write_text("\n".join([*lines[:at], "f 1 1 2", *lines[at:], "f 3 3 3"]) + "\n")
    given = read_mesh(mesh)
    out, model = tmp_path / "out", tmp_path / "model.ply"
    folder = str(tmp_path / "corner")
    assert run(["fair", folder, "--out", str(out), "--points", "none"]) == 0
    np.testing.assert_array_equal(read_mesh(out / "mesh.ply")[1], given[1])
    report = json.loads((out / "report.json").read_text())
    without_area = [item["face"] for item in report["skipped"]["faces"] if "degenerate" in item["reasons"]]
    assert without_area == [0, 7]
    assert any("degenerate faces: 2 (first: 0)" in warning for warning in report["warnings"])
    assert run(["texture", folder, "--out", str(model), "--size", "256"]) == 0
    assert len(read_mesh(model)[1]) == len(given[1])


def test_the_check_judges_the_faces_with_area():
    check = check_scene(corner_with(*DEGENERATE["a repeated corner"]))
    assert (check.n_faces, check.faces_in_part) == (6, 6)


def test_the_texture_of_the_other_faces_is_the_same():
    scene = corner_with(*DEGENERATE["a repeated corner"], first=True)
    one, other = (textured_model(s, s.mesh.vertices, 256) for s in (corner_scene(), scene))
    np.testing.assert_array_equal(one.image, other.image)
    np.testing.assert_array_equal(one.uv, other.uv)


def test_rounded_copies_are_named(tmp_path: Path):
    write_corner(tmp_path)
    mesh = tmp_path / "mesh.obj"
    lines = mesh.read_text().splitlines()
    x, y, z = map(float, lines[7].split()[1:])
    lines[7] = f"v {x + 1e-6!r} {y!r} {z!r}"
    mesh.write_text("\n".join(lines) + "\n")
    scene = load_scene(tmp_path)
    assert len(scene.mesh.vertices) == 7
    assert scene.warnings == (
        "mesh: vertices that differ from another by rounding: 1 (first: 7; at most 6e-07 of the diagonal apart); "
        "they are moved as one",
    )


def test_a_surface_that_too_few_photos_see_says_so():
    scene = corner_scene()
    away = np.vstack([scene.mesh.vertices, [[0.0, 0, -1], [1, 0, -1], [0, -1, -1]]])
    scene = Scene.build("part", away, np.vstack([FACES, [[7, 8, 9]]]), scene.views)
    session = finished(scene, small_options(locked_vertices=(0, 1, 2, 3, 4, 5, 6)))
    assert session.could_move_nothing
    assert session.stop_reason == (
        "finished: no vertex could move: 7 of 10 vertices are locked; fewer than three photos see the faces of the others"
    )
    assert run_report(session, "accurate", {}, {})["stop_reason"] == session.stop_reason


def test_a_mesh_of_faces_without_area_is_refused():
    with pytest.raises(InputError, match="all 2 faces have no area"):
        Scene.build("flat", CORNER, np.array([[0, 0, 1], [1, 2, 2]]), corner_scene().views)
