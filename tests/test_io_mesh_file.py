"""Mesh files: every format, order kept, exact round trips, writing that never leaves half a file."""

import errno
import json
import os
import resource
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pytest
import trimesh

from fairing.errors import InputError
from fairing.io import read_mesh, write_atomically, write_mesh
from fairing.io.scan_file import read_scan
from fairing.util.budget import FREE_BYTES, RATIO
from tests.synthetic_capture import CUBE_FACES, CUBE_VERTICES

RNG = np.random.default_rng(0)
VERTICES = RNG.normal(size=(50, 3)) * 10.0 ** RNG.integers(-12, 12, (50, 3))
FACES = RNG.integers(0, 40, (70, 3))
"""The last vertices are used by no face; some faces repeat a corner."""


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".PLY"])
def test_written_mesh_reads_back_to_the_last_bit(tmp_path: Path, suffix: str):
    path = tmp_path / f"mesh{suffix}"
    write_mesh(path, VERTICES, FACES)
    vertices, faces = read_mesh(path)
    np.testing.assert_array_equal(vertices, VERTICES)
    np.testing.assert_array_equal(faces, FACES)


@pytest.mark.parametrize("suffix", [".ply", ".obj"])
def test_written_mesh_is_understood_by_trimesh(tmp_path: Path, suffix: str):
    write_mesh(tmp_path / f"mesh{suffix}", CUBE_VERTICES, CUBE_FACES)
    mesh = trimesh.load_mesh(tmp_path / f"mesh{suffix}", process=False)
    np.testing.assert_array_equal(mesh.vertices[mesh.faces], CUBE_VERTICES[CUBE_FACES])


@pytest.mark.parametrize("suffix", [".ply", ".off", ".stl", ".glb", ".gltf", ".obj"])
def test_every_format_of_trimesh_is_read_in_order(tmp_path: Path, suffix: str):
    mesh = trimesh.Trimesh(CUBE_VERTICES, CUBE_FACES, process=False)
    if suffix == ".gltf":
        for name, data in trimesh.Scene(mesh).export(file_type="gltf").items():
            (tmp_path / name.replace("model", "mesh")).write_bytes(data)
    else:
        mesh.export(tmp_path / f"mesh{suffix}")
    vertices, faces = read_mesh(tmp_path / f"mesh{suffix}")
    if suffix != ".stl":  # which has no shared vertices
        np.testing.assert_array_equal(vertices, CUBE_VERTICES)
        np.testing.assert_array_equal(faces, CUBE_FACES)
    np.testing.assert_array_equal(vertices[faces], CUBE_VERTICES[CUBE_FACES])


def test_parts_of_a_glb_are_put_in_their_place_and_joined(tmp_path: Path):
    mesh = trimesh.Trimesh(CUBE_VERTICES, CUBE_FACES, process=False)
    scene = trimesh.Scene()
    turn = np.array([[0.0, -2, 0, 5], [2, 0, 0, 0], [0, 0, 2, 0], [0, 0, 0, 1]])
    scene.add_geometry(mesh, transform=turn)
    scene.add_geometry(mesh)
    scene.export(tmp_path / "two.glb")
    vertices, faces = read_mesh(tmp_path / "two.glb")
    placed = [CUBE_VERTICES @ turn[:3, :3].T + turn[:3, 3], CUBE_VERTICES]
    assert len(vertices) == 16
    assert len(faces) == 24
    triangles = {tuple(triangle.ravel()) for triangle in np.round(vertices[faces], 5)}
    assert triangles == {tuple(triangle.ravel()) for part in placed for triangle in np.round(part[CUBE_FACES], 5)}


def test_textured_obj_keeps_its_vertices(tmp_path: Path):
    """Each corner with a texture coordinate of its own, negative indices, polygons, a vertex that no face uses."""
    (tmp_path / "m.obj").write_text(
        "mtllib none.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0 0.5 0.5 0.5\nv 0 1 0\nv 5 5 5\n"
        "vt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\nusemtl brick\nf 1/1/1 2/2/1 3/3/1\nf 3/1 4/2 1/3\nf -5//1 -4 -3 -2\n"
    )
    vertices, faces = read_mesh(tmp_path / "m.obj")
    assert vertices.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [5, 5, 5]]
    assert faces.tolist() == [[0, 1, 2], [2, 3, 0], [0, 1, 2], [0, 2, 3]]


PLY_HEADER = "ply\nformat ascii 1.0\n{extra}element vertex 4\nproperty double x\nproperty double y\nproperty double z\n"
PLY_POINTS = "0.1234567890123456 0 0\n1 0 0\n1 1 0\n0 1 0\n"


def test_textured_ply_keeps_its_vertices(tmp_path: Path):
    (tmp_path / "m.ply").write_text(
        PLY_HEADER.format(extra="comment TextureFile none.png\n")
        + "element face 2\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\nend_header\n"
        + PLY_POINTS
        + "3 0 1 2 6 0 0 1 0 1 1\n3 0 2 3 6 0.5 0 1 0 1 1\n"
    )
    vertices, faces = read_mesh(tmp_path / "m.ply")
    assert vertices.tolist() == [[0.1234567890123456, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    assert faces.tolist() == [[0, 1, 2], [0, 2, 3]]


def test_quads_become_triangles(tmp_path: Path):
    (tmp_path / "m.ply").write_text(
        PLY_HEADER.format(extra="")
        + "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
        + PLY_POINTS
        + "4 0 1 2 3\n"
    )
    vertices, faces = read_mesh(tmp_path / "m.ply")
    assert len(vertices) == 4
    assert sorted(map(sorted, faces.tolist())) == [[0, 1, 2], [0, 2, 3]]


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("m.ply", PLY_HEADER.format(extra="") + "end_header\n" + PLY_POINTS, "found no faces"),
        ("m.obj", "v 0 0 0\nv 1 0 0\n", "found no faces"),
        ("m.obj", "", "found no faces"),
        ("m.ply", "", "expected a PLY header"),
        ("m.glb", "hello", "cannot be read"),
        ("m.gltf", json.dumps({"asset": {"version": "2.0"}}), r"m\.gltf: expected a"),
        ("m.stl", "solid\n", r"m\.stl: expected three vertices for each facet up to `endsolid`"),
        ("m.off", "OFF\n3 1 0\n0 0", "expected 3 vertices and 1 faces as declared, one line each, found 1 lines"),
        ("m.obj", "v 0 0\n", "line 1: expected `v x y z`"),
        ("m.obj", "v 0 0 0\nf 1 2\n", "line 2: expected"),
        ("m.obj", "v 0 0 0\nf 0 1 1\n", "line 2: expected"),
        ("m.txt", "v 0 0 0", r"expected a mesh .*found \.txt"),
        ("mesh", "v 0 0 0", "found no suffix"),
    ],
)
def test_unusable_mesh_file_is_one_clear_line(tmp_path: Path, name: str, content: str, said: str):
    (tmp_path / name).write_text(content)
    with pytest.raises(InputError, match=said) as error:
        read_mesh(tmp_path / name)
    assert str(tmp_path / name) in str(error.value)
    assert "\n" not in str(error.value)


def test_missing_mesh_file_is_one_clear_line(tmp_path: Path):
    with pytest.raises(InputError, match=r"none\.ply: expected a mesh, found no such file"):
        read_mesh(tmp_path / "none.ply")
    (tmp_path / "folder.ply").mkdir()
    with pytest.raises(InputError, match=r"folder\.ply: expected a mesh, cannot be read"):
        read_mesh(tmp_path / "folder.ply")


@pytest.mark.parametrize("suffix", [".ply", ".stl", ".glb"])
def test_binary_mesh_truncated_anywhere_is_one_clear_line(tmp_path: Path, suffix: str):
    path = tmp_path / f"m{suffix}"
    trimesh.Trimesh(CUBE_VERTICES, CUBE_FACES, process=False).export(path)
    data = path.read_bytes()
    for length in np.linspace(0, len(data) - 60, 40).astype(int):
        path.write_bytes(data[:length])
        with pytest.raises(InputError) as error:
            read_mesh(path)
        assert "\n" not in str(error.value)


def test_meshes_are_written_only_as_ply_or_obj(tmp_path: Path):
    with pytest.raises(InputError, match=r"written as \.ply or \.obj"):
        write_mesh(tmp_path / "m.stl", CUBE_VERTICES, CUBE_FACES)
    assert list(tmp_path.iterdir()) == []


def test_failed_write_leaves_the_old_file_and_nothing_else(tmp_path: Path):
    path = tmp_path / "mesh.ply"
    path.write_text("old")

    def fill_the_disk(file: BinaryIO) -> None:
        file.write(b"half")
        raise OSError(errno.ENOSPC, "No space left on device")

    with pytest.raises(InputError, match=r"mesh\.ply: could not be written \(No space left on device\); free space"):
        write_atomically(path, fill_the_disk)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_write_beyond_the_allowed_size_leaves_the_old_file(tmp_path: Path):
    """A real failure of the operating system, in the middle of a file."""
    path = tmp_path / "mesh.ply"
    write_mesh(path, CUBE_VERTICES, CUBE_FACES)
    before = path.read_bytes()
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        with pytest.raises(InputError, match="could not be written"):
            write_mesh(path, VERTICES, FACES)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_interrupted_write_leaves_nothing(tmp_path: Path):
    def interrupt(file: BinaryIO) -> None:
        file.write(b"half")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_atomically(tmp_path / "new.ply", interrupt)
    assert list(tmp_path.iterdir()) == []


def test_write_into_a_missing_folder_says_so(tmp_path: Path):
    with pytest.raises(InputError, match="create the folder"):
        write_mesh(tmp_path / "none" / "mesh.ply", CUBE_VERTICES, CUBE_FACES)


# ---------------------------------------------------------------------- what a mesh file refers to and declares


def write_gltf(folder: Path, change: Callable[[dict[str, Any]], object] = lambda header: None) -> Path:
    """A valid mesh.gltf with its data in a file of its own, whose header is then changed."""
    folder.mkdir(exist_ok=True)
    mesh = trimesh.Trimesh(CUBE_VERTICES, CUBE_FACES, process=False)
    parts = trimesh.Scene(mesh).export(file_type="gltf")
    header = json.loads(parts.pop("model.gltf"))
    for name, data in parts.items():
        (folder / name).write_bytes(data)
    change(header)
    (folder / "mesh.gltf").write_text(json.dumps(header))
    return folder / "mesh.gltf"


def named(uri: str) -> Callable[[dict[str, Any]], object]:
    return lambda header: header["buffers"][0].update(uri=uri)


def refused(path: Path, said: str) -> None:
    with pytest.raises(InputError, match=said) as error:
        read_mesh(path)
    assert "\n" not in str(error.value)
    assert str(path.parent) in str(error.value)


def test_a_gltf_reads_only_files_of_its_folder(tmp_path: Path):
    (tmp_path / "secret.bin").write_bytes(b"\0" * 10_000)
    for uri in ("../secret.bin", str(tmp_path / "secret.bin"), "%2e%2e/secret.bin", "x/../../secret.bin"):
        path = write_gltf(tmp_path / "mesh", named(uri))
        refused(path, r"mesh\.gltf: expected the files it refers to in its folder, found no")
    (tmp_path / "mesh" / "link.bin").symlink_to(tmp_path / "secret.bin")
    refused(write_gltf(tmp_path / "mesh", named("link.bin")), "in its folder")
    for uri in ("", "none.bin", "a\0b", "n" * 5000, "http://127.0.0.1:9/x.bin"):
        refused(write_gltf(tmp_path / "mesh", named(uri)), r"mesh\.gltf")


def test_names_in_a_gltf_may_be_percent_encoded(tmp_path: Path):
    def rename(header: dict[str, Any]) -> None:
        (tmp_path / header["buffers"][0]["uri"]).rename(tmp_path / "part one.bin")
        header["buffers"][0]["uri"] = "part%20one.bin"

    path = write_gltf(tmp_path, rename)
    np.testing.assert_array_equal(read_mesh(path)[0], CUBE_VERTICES)


def test_a_pipe_that_a_gltf_refers_to_is_refused_at_once(tmp_path: Path):
    """Opening a pipe without a writer would block for ever."""
    path = write_gltf(tmp_path, named("pipe.bin"))
    os.mkfifo(tmp_path / "pipe.bin")
    refused(path, "pipe.bin: expected .*found a pipe")


def test_materials_are_not_read(tmp_path: Path):
    """A pipe as material file or texture would block for ever."""
    os.mkfifo(tmp_path / "pipe.png")
    os.mkfifo(tmp_path / "pipe.mtl")
    lines = [f"v {x} {y} {z}" for x, y, z in CUBE_VERTICES] + [f"f {a} {b} {c}" for a, b, c in CUBE_FACES + 1]
    (tmp_path / "scan.obj").write_text("mtllib pipe.mtl\nusemtl a\n" + "\n".join(lines))
    assert len(getattr(read_scan(tmp_path / "scan.obj"), "faces", ())) == len(CUBE_FACES)
    header = PLY_HEADER.format(extra="comment TextureFile pipe.png\n") + "end_header\n" + PLY_POINTS
    (tmp_path / "scan.ply").write_text(header)
    assert len(read_scan(tmp_path / "scan.ply")) == 4  # type: ignore[arg-type]

    def add_texture(header: dict[str, Any]) -> None:
        header["images"] = [{"uri": "pipe.png"}]
        header["textures"] = [{"source": 0}]
        header["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
        header["meshes"][0]["primitives"][0]["material"] = 0

    assert len(read_mesh(write_gltf(tmp_path / "mesh", add_texture))[1]) == len(CUBE_FACES)


def test_references_to_too_much_data_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    path = write_gltf(tmp_path)
    size = sum(data.stat().st_size for data in tmp_path.glob("*.bin"))
    monkeypatch.setattr("fairing.io.neighbours.MAX_BYTES", 3 * size)
    assert len(read_mesh(path)[0]) == len(CUBE_VERTICES)

    def repeat(header: dict[str, Any]) -> None:
        """Primitives whose indices lie in further buffers, all in one file."""
        primitives, accessors = header["meshes"][0]["primitives"], header["accessors"]
        indices = accessors[primitives[0]["indices"]]
        view = header["bufferViews"][indices["bufferView"]]
        for _ in range(8):
            header["buffers"].append(header["buffers"][view["buffer"]])
            header["bufferViews"].append(view | {"buffer": len(header["buffers"]) - 1})
            accessors.append(indices | {"bufferView": len(header["bufferViews"]) - 1})
            primitives.append(primitives[0] | {"indices": len(accessors) - 1})

    refused(write_gltf(tmp_path, repeat), "expected references to at most")


def test_a_sparse_file_of_terabytes_is_refused_at_once(tmp_path: Path):
    path = write_gltf(tmp_path, named("huge.bin"))
    with (tmp_path / "huge.bin").open("wb") as file:
        file.truncate(1 << 42)
    refused(path, "expected references to at most 1024 MiB")


def declared(key: str, **values: object) -> Callable[[dict[str, Any]], object]:
    return lambda header: header[key][0].update(values)


def endless_nodes(header: dict[str, Any]) -> None:
    """A node that holds 100,000 instances of each node."""
    nodes = header["nodes"]
    nodes.append({"children": list(range(len(nodes))) * 10**5})
    header["scenes"][0]["nodes"] = [len(nodes) - 1]


def zeros(header: dict[str, Any]) -> None:
    header["accessors"][0]["count"] = 1 << 40
    del header["accessors"][0]["bufferView"]


def sparse_zeros(header: dict[str, Any]) -> None:
    zeros(header)
    at = {"bufferView": 0, "componentType": 5125}
    header["accessors"][0] |= {"count": 1 << 26, "sparse": {"count": 1, "indices": at, "values": {"bufferView": 1}}}


def many_instances(header: dict[str, Any]) -> None:
    """40 bytes for each further copy of the mesh, which has 480 bytes as arrays: one hundred times as many are no mesh."""
    primitives = header["meshes"][0]["primitives"]
    primitives *= 100
    for primitive in primitives:
        primitive["attributes"] = dict(primitive["attributes"])
    header["nodes"] = [{"mesh": 0}] * 20_000
    header["scenes"][0]["nodes"] = list(range(20_000))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (zeros, r"expected data \(a bufferView\), found none"),
        (sparse_zeros, "MiB of data from .* bytes, found declarations of"),
        (declared("bufferViews", byteLength=1 << 50), "expected .* values in"),
        (declared("accessors", count=1 << 60), "expected 1152921504606846976 values in"),
        (endless_nodes, "expected one place in the scene, found two"),
        (many_instances, "MiB of data from .* bytes, found declarations of"),
    ],
    ids=["zeros", "sparse zeros", "view", "accessor", "nodes", "instances"],
)
def test_a_gltf_that_declares_more_than_it_holds_is_refused_before_it_is_made(
    tmp_path: Path, change: Callable[[dict[str, Any]], object], said: str
):
    path = write_gltf(tmp_path, change)
    tracemalloc.start()
    refused(path, said)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    # The JSON as objects takes some tens of times its text.
    assert peak < FREE_BYTES + (RATIO + 80) * path.stat().st_size, f"{peak / 2**20:.0f} MiB"


@pytest.mark.parametrize(
    "change", [declared("accessors", count=-1), declared("accessors", count="7"), declared("accessors", type=[]),
               lambda header: header.update(nodes=5), lambda header: header.update(meshes={"a": 1})]
)  # fmt: skip
def test_a_gltf_with_declarations_of_another_kind_is_refused(
    tmp_path: Path, change: Callable[[dict[str, Any]], object]
):
    refused(write_gltf(tmp_path, change), r"mesh\.gltf: [\w.\[\]]+: expected")
