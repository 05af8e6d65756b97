"""Mesh files as programs write them, and files that are less than they declare."""

import json
import struct
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from fairing.errors import InputError
from fairing.io import load_scene, read_mesh, write_mesh
from fairing.io.colmap_text import read_text_model
from fairing.io.scan_file import read_scan
from fairing.mesh_formats import polygons
from fairing.mesh_formats.obj import parse_obj
from fairing.mesh_formats.polygons import Polygons, triangulated
from fairing.util.budget import FREE_BYTES, RATIO
from tests.synthetic_capture import CUBE_FACES, CUBE_VERTICES, write_colmap_capture


def refused(path: Path, said: str, read: Callable[[Path], object] = read_mesh) -> None:
    with pytest.raises(InputError, match=said) as error:
        read(path)
    assert "\n" not in str(error.value)
    assert str(path) in str(error.value)


def area(vertices: np.ndarray, faces: np.ndarray) -> float:
    corners = vertices[faces]
    return float(
        np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
    )


# ---------------------------------------------------------------------- polygons

ARROW = [(0, 0), (2, 0), (2, 1), (1, 0.25), (0, 1)]
COMB = [(0, 0), (7, 0), (7, 3), (6, 1), (5, 3), (4, 1), (3, 3), (2, 1), (1, 3), (0.5, 1)]
SPIRAL = [(0, 0), (4, 0), (4, 4), (1, 4), (1, 2), (2, 2), (2, 3), (3, 3), (3, 1), (0, 1)]
MIDPOINTS = [(0, 0), (1, 0), (2, 0), (2, 1), (2, 2), (1, 2), (0, 2), (0, 1)]
KEYHOLE = [(0, 0), (4, 0), (4, 4), (0, 4), (0, 0), (1, 1), (1, 3), (3, 3), (3, 1), (1, 1)]
"""A square with a square hole, cut open."""


def shoelace(points: np.ndarray) -> float:
    x, y = points.T
    return float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2)


@pytest.mark.parametrize("turn", range(10))
@pytest.mark.parametrize("shape", [ARROW, COMB, SPIRAL, MIDPOINTS, KEYHOLE])
def test_a_concave_polygon_keeps_its_area_and_its_side(shape: list, turn: int):
    """Whatever its first corner and its plane: triangles of one sign that add up to the area cover the polygon once."""
    flat = np.roll(np.array(shape, dtype=float), turn, axis=0)
    axes = np.linalg.qr(np.random.default_rng(turn).normal(size=(3, 3)))[0]
    vertices = 1000 * flat @ axes[:2] + 5e5
    corners = np.arange(len(flat))
    faces = corners[triangulated(vertices, Polygons(corners, np.array([len(flat)])))]
    assert len(faces) == len(flat) - 2
    areas = np.array([shoelace(flat[face]) for face in faces])
    assert (areas >= -1e-12).all(), areas
    assert areas.sum() == pytest.approx(shoelace(flat), rel=1e-12)


@pytest.mark.parametrize("suffix", [".obj", ".off", ".ply"])
def test_concave_faces_are_cut_right_in_every_format(tmp_path: Path, suffix: str):
    rows = [f"{x} {y} 0" for x, y in ARROW]
    text = {
        ".obj": "\n".join([*(f"v {row}" for row in rows), "f 1 2 3 4 5"]),
        ".off": "\n".join(["OFF", "5 1 0", *rows, "5 0 1 2 3 4"]),
        ".ply": "\n".join([
            "ply", "format ascii 1.0", "element vertex 5", *(f"property float {axis}" for axis in "xyz"), "element face 1",
            "property list uchar int vertex_index", "end_header", *rows, "5 0 1 2 3 4",
        ]),
    }[suffix]  # fmt: skip
    (tmp_path / f"m{suffix}").write_text(text + "\n")
    assert area(*read_mesh(tmp_path / f"m{suffix}")) == pytest.approx(shoelace(np.array(ARROW)))


def test_convex_polygons_are_fans(tmp_path: Path):
    circle = np.exp(2j * np.pi * np.arange(50) / 50)
    rows = "\n".join(f"v {z.real} {z.imag} 0" for z in circle)
    (tmp_path / "m.obj").write_text(f"{rows}\nf {' '.join(map(str, range(1, 51)))}\n")
    assert read_mesh(tmp_path / "m.obj")[1].tolist() == [[0, i, i + 1] for i in range(1, 49)]


def test_a_huge_concave_polygon_is_refused_instead_of_computed_for_hours(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(polygons, "MOST_CORNERS", 4)
    rows = "\n".join(f"v {x} {y} 0" for x, y in ARROW)
    (tmp_path / "m.obj").write_text(f"{rows}\nf 1 2 3 4 5\n")
    refused(tmp_path / "m.obj", "face 0: expected a concave polygon of at most 4 corners, found 5")


# ---------------------------------------------------------------------- PLY

XYZ = "property float x\nproperty float y\nproperty float z\n"
FACE_LIST = "property list uchar int vertex_indices\n"


def binary_ply(items: str, body: bytes) -> bytes:
    return f"ply\nformat binary_little_endian 1.0\n{items}end_header\n".encode() + body


SQUARE = struct.pack("<12f", 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0)


def test_a_binary_ply_may_mix_triangles_and_quads(tmp_path: Path):
    faces = struct.pack("<B3i", 3, 0, 1, 2) + struct.pack("<B4i", 4, 0, 1, 2, 3) + struct.pack("<B3i", 3, 2, 3, 0)
    (tmp_path / "m.ply").write_bytes(binary_ply(f"element vertex 4\n{XYZ}element face 3\n{FACE_LIST}", SQUARE + faces))
    vertices, found = read_mesh(tmp_path / "m.ply")
    assert found.tolist() == [[0, 1, 2], [0, 1, 2], [0, 2, 3], [2, 3, 0]]
    write_mesh(tmp_path / "out.ply", vertices + 1, found, like=tmp_path / "m.ply")
    assert (tmp_path / "out.ply").read_bytes().endswith(faces)


@pytest.mark.parametrize("form", ["ascii", "binary"])
def test_triangle_strips_of_a_ply_are_read(tmp_path: Path, form: str):
    """Two strips, one of them with a repeated corner; every second triangle is turned over."""
    strips = [0, 1, 3, 2, -1, 1, 2, 2, 3]
    items = f"element vertex 4\n{XYZ}element tristrips 1\nproperty list int int vertex_indices\n"
    if form == "binary":
        content = binary_ply(items, SQUARE + struct.pack("<10i", 9, *strips))
    else:
        text = f"ply\nformat ascii 1.0\n{items}end_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n9 {' '.join(map(str, strips))}\n"
        content = text.encode()
    (tmp_path / "m.ply").write_bytes(content)
    vertices, faces = read_mesh(tmp_path / "m.ply")
    assert faces.tolist() == [[0, 1, 3], [3, 1, 2]]
    assert area(vertices, faces) == 1


def test_indices_that_are_no_whole_numbers_are_refused(tmp_path: Path):
    text = f"ply\nformat ascii 1.0\nelement vertex 4\n{XYZ}element face 1\n{FACE_LIST}end_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n"
    for face in ("3 0 1.9 2", "3 0 1e0 2", "3 0 1_0 2", "3.0 0 1 2", "3 0 1"):
        (tmp_path / "m.ply").write_text(f"{text}{face}\n")
        refused(
            tmp_path / "m.ply", "line 14: expected (whole numbers vertex_indices|the properties of element face), found"
        )
    (tmp_path / "m.ply").write_text(text.replace("uchar int", "uchar float") + "3 0 1.9 2\n")
    refused(tmp_path / "m.ply", "expected whole numbers vertex_indices, found type float")


# ---------------------------------------------------------------------- OBJ


def test_an_obj_in_latin_1_with_continued_lines_is_read(tmp_path: Path):
    (tmp_path / "m.obj").write_bytes(
        b"# Stra\xdfe \\\nv 0 0 0 \nv 1 0 \\\r\n 0\nv 1 1 0\ng T\xfcr\nv 0 1 0\nf 1 2 \\\n3 \\\n4\n\tf 1 3 4 # \xe9\n"
    )
    vertices, faces = read_mesh(tmp_path / "m.obj")
    assert vertices.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    assert faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 2, 3]]


@pytest.mark.parametrize(
    "line", ["v 0,5 1 2", "v 1_0 0 0", "f 1/x 2 3", "f 1/2/3/4 2 3", "f 1 2 3.0", "vn 0 0", "f 1//-2 2 3"]
)
def test_a_malformed_line_of_an_obj_is_named(tmp_path: Path, line: str):
    (tmp_path / "m.obj").write_text(f"v 0 0 0\nv 1 0 0\nv 1 1 0\nvn 0 0 1\n{line}\nf 1 2 3\n")
    refused(tmp_path / "m.obj", "line 5: expected `v x y z` or `f a b c`, found")


# ---------------------------------------------------------------------- counts

OFF = "OFF\n8 12 0\n" + "\n".join(" ".join(map(str, v)) for v in CUBE_VERTICES)
OFF_FACES = [f"3 {a} {b} {c}" for a, b, c in CUBE_FACES]


@pytest.mark.parametrize("n", [*range(12), 13])
def test_an_off_with_another_number_of_faces_than_declared_is_refused(tmp_path: Path, n: int):
    (tmp_path / "m.off").write_text("\n".join([OFF, *(OFF_FACES * 2)[:n]]) + "\n")
    refused(tmp_path / "m.off", "expected 8 vertices and 12 faces as declared")


def truncations(data: bytes) -> list[bytes]:
    return [data[:length] for length in np.linspace(0, len(data) - 2, 60).astype(int)]


@pytest.mark.parametrize("form", ["ascii ply", "binary ply", "off", "stl", "ascii stl", "glb"])
def test_a_truncated_mesh_is_refused_wherever_it_ends(tmp_path: Path, form: str):
    mesh = trimesh.Trimesh(CUBE_VERTICES, CUBE_FACES, process=False)
    kind = form.split()[-1]
    options = {"ascii ply": {"encoding": "ascii"}}.get(form, {})
    data = mesh.export(file_type="stl_ascii" if form == "ascii stl" else kind, **options)
    data = data.encode() if isinstance(data, str) else data
    path = tmp_path / f"m.{kind}"
    path.write_bytes(data)
    assert len(read_mesh(path)[1]) == 12
    for part in truncations(data.rstrip()):
        if part.rstrip() == data.rstrip():
            continue
        path.write_bytes(part)
        refused(path, "expected|cannot be read as glTF")


@pytest.mark.parametrize("count", [2**31, 2**50, 10**17, 13, 11])
@pytest.mark.parametrize("form", ["ascii", "binary"])
@pytest.mark.parametrize("element", ["vertex", "face"])
def test_a_ply_that_declares_another_number_of_items_is_refused_at_once(
    tmp_path: Path, count: int, form: str, element: str
):
    mesh = trimesh.Trimesh(CUBE_VERTICES, CUBE_FACES, process=False)
    data = mesh.export(file_type="ply", encoding=form)
    old = 8 if element == "vertex" else 12
    path = tmp_path / "m.ply"
    path.write_bytes(data.replace(f"element {element} {old}".encode(), f"element {element} {count}".encode()))
    tracemalloc.start()
    refused(path, "expected")
    assert tracemalloc.get_traced_memory()[1] < 1 << 20
    tracemalloc.stop()


def test_a_stl_or_off_that_declares_billions_is_refused_at_once(tmp_path: Path):
    (tmp_path / "m.stl").write_bytes(bytes(80) + struct.pack("<I", 2**31) + bytes(50))
    (tmp_path / "m.off").write_text(OFF.replace("8 12 0", f"8 {2**31} 0") + "\n3 0 1 2\n")
    tracemalloc.start()
    refused(tmp_path / "m.stl", "expected an STL of 2147483648 triangles .* as declared, found 134 bytes")
    refused(tmp_path / "m.off", "expected 8 vertices and 2147483648 faces as declared")
    assert tracemalloc.get_traced_memory()[1] < 1 << 20
    tracemalloc.stop()


# ---------------------------------------------------------------------- XYZ


@pytest.mark.parametrize(
    "text",
    ["0,5 1,5 2,5\n", "0,5;1,5;2,5\n", "0,5,1,5,2,5\n1,5,2,5,3,5\n", "1 2 3\n0,5\t1,5\t2,5\n", "0,5, 1,5, 2,5\n"],
)  # fmt: skip
def test_points_with_decimal_commas_are_refused(tmp_path: Path, text: str):
    (tmp_path / "m.xyz").write_text(text)
    refused(tmp_path / "m.xyz", r"line [12]: expected numbers with decimal points, found commas", read_scan)


@pytest.mark.parametrize(
    "text",
    ["0.5 1.5 2.5\n1 2 3\n", "0.5,1.5,2.5\n1,2,3\n", "0.5, 1.5, 2.5\n1, 2, 3\n", "0.5;1.5;2.5\n1;2;3\n",
     "# a comment\n0.5 1.5 2.5 255 0 0\n\n1 2 3 0 0 9\n", "2\n0.5 1.5 2.5\n1 2 3\n", "0.5,1.5,2.5,7,8,9\n1,2,3,7,8,9\n"],
)  # fmt: skip
def test_points_with_any_usual_separator_are_read(tmp_path: Path, text: str):
    (tmp_path / "m.xyz").write_text(text)
    np.testing.assert_array_equal(read_scan(tmp_path / "m.xyz"), [[0.5, 1.5, 2.5], [1, 2, 3]])


@pytest.mark.parametrize("text", ["1 2\n", "1 2 x\n", "1_0 2 3\n", "3\n1 2 3\n4 5 6\n"])
def test_malformed_points_are_refused(tmp_path: Path, text: str):
    (tmp_path / "m.xyz").write_text(text)
    refused(tmp_path / "m.xyz", "expected (three numbers|3 points as declared)", read_scan)


# ---------------------------------------------------------------------- glTF


def glb(content: dict[str, Any], binary: bytes) -> bytes:
    text = json.dumps({"asset": {"version": "2.0"}, "buffers": [{"byteLength": len(binary)}]} | content).encode()
    text += b" " * (-len(text) % 4)
    binary += bytes(-len(binary) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def square_glb(mode: int, indices: list[int], **changes: Any) -> bytes:
    """A unit square of four vertices, with the given indices (unsigned bytes)."""
    data = SQUARE + bytes(indices)
    content = {
        "meshes": [{"primitives": [{"mode": mode, "attributes": {"POSITION": 0}, "indices": 1}]}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5121, "count": len(indices), "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": len(indices)},
        ],
    }
    return glb(content | changes, data)


@pytest.mark.parametrize(
    ("mode", "indices", "expected"),
    [
        (4, [0, 1, 2, 0, 2, 3], [[0, 1, 2], [0, 2, 3]]),
        (5, [0, 1, 3, 2], [[0, 1, 3], [3, 1, 2]]),
        (5, [0, 1, 3, 3, 3, 1, 1, 2, 3], [[0, 1, 3], [1, 2, 3]]),
        (6, [0, 1, 2, 3], [[0, 1, 2], [0, 2, 3]]),
    ],
    ids=["triangles", "strip", "stitched strip", "fan"],
)  # fmt: skip
def test_triangle_strips_and_fans_of_a_gltf_are_read(tmp_path: Path, mode: int, indices: list[int], expected: list):
    (tmp_path / "m.glb").write_bytes(square_glb(mode, indices))
    vertices, faces = read_mesh(tmp_path / "m.glb")
    assert area(vertices, faces) == 1
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (normals[:, 2] > 0).all()
    assert sorted(map(sorted, faces.tolist())) == sorted(map(sorted, expected))


def test_a_mirrored_node_turns_its_triangles_over(tmp_path: Path):
    (tmp_path / "m.glb").write_bytes(square_glb(4, [0, 1, 2, 0, 2, 3], nodes=[{"mesh": 0, "scale": [-1, 1, 1]}]))
    vertices, faces = read_mesh(tmp_path / "m.glb")
    corners = vertices[faces]
    assert (np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] > 0).all()


@pytest.mark.parametrize("component", [5120, 5121, 5122, 5123])
@pytest.mark.parametrize("normalized", [False, True])
def test_quantized_positions_are_read_as_they_are_meant(tmp_path: Path, component: int, normalized: bool):
    """KHR_mesh_quantization: integers, or fractions of the largest one."""
    dtype = {5120: np.int8, 5121: np.uint8, 5122: np.dtype("<i2"), 5123: np.dtype("<u2")}[component]
    largest = np.iinfo(dtype).max
    values = np.array([[0, 0, 0], [largest, 0, 0], [largest, largest, 0], [0, largest, 0]], dtype)
    stride = 4 if values.itemsize == 1 else 8
    padded = np.zeros((4, stride // values.itemsize), dtype)
    padded[:, :3] = values
    data = padded.tobytes() + bytes([0, 1, 2, 0, 2, 3])
    content = {
        "extensionsRequired": ["KHR_mesh_quantization"],
        "extensionsUsed": ["KHR_mesh_quantization"],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "nodes": [{"mesh": 0, "scale": [2, 2, 2]}],
        "accessors": [
            {"bufferView": 0, "componentType": component, "count": 4, "type": "VEC3", "normalized": normalized},
            {"bufferView": 1, "componentType": 5121, "count": 6, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 4 * stride, "byteStride": stride},
            {"buffer": 0, "byteOffset": 4 * stride, "byteLength": 6},
        ],
    }
    (tmp_path / "m.glb").write_bytes(glb(content, data))
    side = 2 if normalized else 2 * largest
    np.testing.assert_allclose(read_mesh(tmp_path / "m.glb")[0], side * np.sign(values.astype(float)), rtol=1e-12)


def test_sparse_positions_are_read(tmp_path: Path):
    data = SQUARE + bytes([0, 1, 2, 0, 2, 3, 0, 0]) + struct.pack("<H2x3f", 2, 5, 6, 7)
    views = [(0, 48), (48, 6), (56, 2), (60, 12)]
    accessors = [
        {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "sparse": {
            "count": 1, "indices": {"bufferView": 2, "componentType": 5123}, "values": {"bufferView": 3}}},
        {"bufferView": 1, "componentType": 5121, "count": 6, "type": "SCALAR"},
    ]  # fmt: skip
    content = {
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": accessors,
        "bufferViews": [{"buffer": 0, "byteOffset": at, "byteLength": length} for at, length in views],
    }
    (tmp_path / "m.glb").write_bytes(glb(content, data))
    assert read_mesh(tmp_path / "m.glb")[0].tolist() == [[0, 0, 0], [1, 0, 0], [5, 6, 7], [0, 1, 0]]


@pytest.mark.parametrize("name", ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "ACME_units", "KHR_mesh_x"])
def test_an_extension_that_is_required_and_not_supported_is_refused_by_name(tmp_path: Path, name: str):
    (tmp_path / "m.glb").write_bytes(square_glb(4, [0, 1, 2], extensionsRequired=[name], extensionsUsed=[name]))
    refused(tmp_path / "m.glb", f"requires the glTF extension {name}, which is not supported")


def test_extensions_of_materials_are_accepted(tmp_path: Path):
    names = [
        "KHR_materials_unlit",
        "KHR_texture_transform",
        "EXT_texture_webp",
        "KHR_texture_basisu",
        "KHR_lights_punctual",
    ]
    (tmp_path / "m.glb").write_bytes(square_glb(4, [0, 1, 2], extensionsRequired=names))
    assert len(read_mesh(tmp_path / "m.glb")[1]) == 1


def test_instances_hidden_in_an_extension_and_other_versions_are_refused_by_name(tmp_path: Path):
    node = {"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 0}}}}
    (tmp_path / "m.glb").write_bytes(square_glb(4, [0, 1, 2], nodes=[node]))
    refused(tmp_path / "m.glb", "EXT_mesh_gpu_instancing, which is not supported")
    (tmp_path / "m.glb").write_bytes(square_glb(4, [0, 1, 2], asset={"version": "1.0"}))
    refused(tmp_path / "m.glb", "expected glTF 2.0, found version 1.0")


def test_a_gltf_of_544_bytes_makes_no_gigabytes(tmp_path: Path):
    """Zeros without data, also as a sparse accessor that changes one of them."""
    zeros = {"componentType": 5126, "count": 1 << 26, "type": "VEC3"}
    sparse = {"count": 1, "indices": {"bufferView": 1, "componentType": 5121}, "values": {"bufferView": 0}}
    indices = {"bufferView": 1, "componentType": 5121, "count": 3, "type": "SCALAR"}
    for accessor in (zeros, zeros | {"sparse": sparse}):
        path = tmp_path / "m.glb"
        path.write_bytes(square_glb(4, [0, 1, 2], accessors=[accessor, indices]))
        tracemalloc.start()
        refused(path, "expected (data|at most 16 MiB of data)")
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < FREE_BYTES + RATIO * path.stat().st_size, peak


# ---------------------------------------------------------------------- folders


def cloud(path: Path) -> None:
    rows = "\n".join("0.5 0.25 1" for _ in range(9))
    path.write_text(f"ply\nformat ascii 1.0\nelement vertex 9\n{XYZ}element face 0\n{FACE_LIST}end_header\n{rows}\n")


def test_a_point_cloud_beside_the_mesh_is_no_mesh(tmp_path: Path):
    write_colmap_capture(tmp_path)
    for name in ("fused.ply", "cloud_and_poses.ply"):
        cloud(tmp_path / name)
    (tmp_path / "points.obj").write_text("# f 1 2 3\nv 0 0 0\nv 1 0 0\n")
    scene = load_scene(tmp_path)
    assert scene.mesh_file == tmp_path / "mesh.obj"
    (tmp_path / "mesh.obj").unlink()
    with pytest.raises(
        InputError, match=r"expected a mesh .*cloud_and_poses\.ply, fused\.ply, points\.obj without faces"
    ) as error:
        load_scene(tmp_path, points="none")
    assert "\n" not in str(error.value)
    write_mesh(tmp_path / "one.ply", CUBE_VERTICES, CUBE_FACES)
    write_mesh(tmp_path / "two.ply", CUBE_VERTICES, CUBE_FACES)
    with pytest.raises(InputError, match=r"expected one mesh, found one\.ply, two\.ply"):
        load_scene(tmp_path)


@pytest.mark.parametrize("declared", [10, 8])
def test_points_of_a_colmap_model_are_as_many_as_declared(tmp_path: Path, declared: int):
    rows = "\n".join(f"{i} 0.5 0.25 1 9 9 9 0.1" for i in range(1, 10))
    (tmp_path / "cameras.txt").write_text("1 PINHOLE 96 72 110 112 47.8 36.6\n")
    (tmp_path / "images.txt").write_text("1 1 0 0 0 0 0 7 1 a.png\n\n")
    points = tmp_path / "points3D.txt"
    points.write_text(f"# Number of points: {declared}, mean track length: 0\n{rows}\n")
    refused(points, f"expected {declared} points as its comment declares, found 9", lambda _: read_text_model(tmp_path))
    points.write_text(f"# Number of points: 9, mean track length: 0\n{rows}\n")
    assert len(read_text_model(tmp_path).points.positions) == 9


def test_corners_of_an_obj_without_texture_coordinate_or_normal_have_none(tmp_path: Path):
    document = parse_obj(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\nf 1 2/1 3//1\nf -3/-1/-1 -2/1/ 3/1\n")
    assert document.corners.tolist() == [[0, -1, -1], [1, 0, -1], [2, -1, 0], [0, 0, 0], [1, 0, -1], [2, 0, -1]]
