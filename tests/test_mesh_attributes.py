"""A mesh that is written like another one has everything of it but the positions: every format, attribute by attribute."""

import json
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from fairing.errors import InputError
from fairing.io import read_mesh, write_mesh
from fairing.io.refined_mesh import write_refined_mesh
from fairing.scene import Scene
from tests.small_scene import FACES, VERTICES, corner_scene

MOVED = VERTICES + np.array([0.25, -0.125, 0.0625])[None] * np.arange(7)[:, None] / 8
"""Of the corner of a cube: other positions, exact in single precision."""


def angle_weighted(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Unit normals of vertices, by trimesh."""
    return trimesh.Trimesh(vertices, faces, process=False).vertex_normals


# ---------------------------------------------------------------------- PLY

PLY = """ply
format {format} 1.0
comment made by hand\xc5
comment TextureFile photo.png
obj_info scanner 7
element vertex 7
property uchar red
property float x
property float y
property float z
property list uchar short cameras
property float quality
property uchar alpha
element face 6
property uchar flags
property list uchar int vertex_indices
property list uchar float texcoord
property int label
element edge 1
property int vertex1
property int vertex2
element material 1
property list uint float values
end_header
"""
CAMERAS = [[1], [], [2, 3], [4], [5], [6], [7, 8, 9]]


def ply_rows() -> tuple[list[str], list[str]]:
    """Lines of the vertices with {} for the coordinates, and all other lines."""
    vertices = [
        f"{200 + i} {{}} {len(c)} {' '.join(map(str, c))} 0.{i}50 {i}".replace("  ", " ") for i, c in enumerate(CAMERAS)
    ]
    others = [f"{i} 3 {a} {b} {c} 6 0 0.5 1 0 0.25 1 {-i}" for i, (a, b, c) in enumerate(FACES.tolist())]
    return vertices, [*others, "0 1", "2 0.5 1.5"]


def text_ply(vertices: np.ndarray, type: str = "float") -> bytes:
    rows, others = ply_rows()
    rows = [row.format(" ".join(map(repr, point))) for row, point in zip(rows, vertices.tolist(), strict=True)]
    header = PLY.format(format="ascii").replace("property float x\nproperty float y\nproperty float z",
                                                f"property {type} x\nproperty {type} y\nproperty {type} z")  # fmt: skip
    return (header + "\n".join([*rows, *others]) + "\n").encode("latin-1")


def binary_ply(order: str, vertices: np.ndarray, type: str = "float") -> bytes:
    name = {"<": "binary_little_endian", ">": "binary_big_endian"}[order]
    header = PLY.format(format=name).replace("property float x\nproperty float y\nproperty float z",
                                             f"property {type} x\nproperty {type} y\nproperty {type} z")  # fmt: skip
    parts = [header.encode("latin-1")]
    for i, (point, cameras) in enumerate(zip(vertices.tolist(), CAMERAS, strict=True)):
        parts.append(struct.pack(f"{order}B3{'f' if type == 'float' else 'd'}", 200 + i, *point))
        parts.append(struct.pack(f"{order}B{len(cameras)}hfB", len(cameras), *cameras, float(f"0.{i}50"), i))
    for i, corners in enumerate(FACES.tolist()):
        parts.append(struct.pack(f"{order}BB3iB6fi", i, 3, *corners, 6, 0, 0.5, 1, 0, 0.25, 1, -i))
    parts.append(struct.pack(f"{order}iiI2f", 0, 1, 2, 0.5, 1.5))
    return b"".join(parts)


@pytest.mark.parametrize("order", ["", "<", ">"])
def test_a_ply_keeps_every_element_property_list_and_comment(tmp_path: Path, order: str):
    def content(vertices: np.ndarray, type: str) -> bytes:
        return binary_ply(order, vertices, type) if order else text_ply(vertices, type)

    (tmp_path / "in.ply").write_bytes(content(VERTICES, "float"))
    vertices, faces = read_mesh(tmp_path / "in.ply")
    np.testing.assert_array_equal(vertices, VERTICES)
    np.testing.assert_array_equal(faces, FACES)
    write_mesh(tmp_path / "out.ply", MOVED, faces, like=tmp_path / "in.ply")
    # Only the coordinates differ; they are written in double precision.
    assert (tmp_path / "out.ply").read_bytes() == content(MOVED, "double")
    np.testing.assert_array_equal(read_mesh(tmp_path / "out.ply")[0], MOVED)


@pytest.mark.parametrize("encoding", ["ascii", "binary"])
def test_normals_of_a_ply_are_computed_anew(tmp_path: Path, encoding: str):
    mesh = trimesh.Trimesh(VERTICES, FACES, process=False)
    (tmp_path / "in.ply").write_bytes(mesh.export(file_type="ply", encoding=encoding, vertex_normal=True))
    assert b"property float nx" in (tmp_path / "in.ply").read_bytes()
    write_mesh(tmp_path / "out.ply", MOVED, FACES, like=tmp_path / "in.ply")
    out = trimesh.load(tmp_path / "out.ply", process=False)
    stored = out.metadata["_ply_raw"]["vertex"]["data"]
    normals = np.column_stack([np.asarray(stored[name]).reshape(-1) for name in ("nx", "ny", "nz")])
    # Single precision.
    np.testing.assert_allclose(normals, angle_weighted(MOVED, FACES), atol=1e-6)


@pytest.mark.parametrize("is_creased", [False, True])
def test_copies_along_a_seam_share_a_normal_and_copies_along_a_crease_do_not(tmp_path: Path, is_creased: bool):
    """Two triangles that meet at an edge whose vertices are there twice."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0], [0, 0, 0], [0, -1, 0.0]])
    moved = vertices + np.array([[0, 0, 0]] * 5 + [[0, 0, 1.0]])
    second = "0 0.6 0.8" if is_creased else "0 0 1"
    rows = [f"{' '.join(map(str, v))} {second if i > 2 else '0 0 1'}" for i, v in enumerate(vertices.tolist())]
    names = "".join(f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz"))
    (tmp_path / "in.ply").write_text(
        f"ply\nformat ascii 1.0\nelement vertex 6\n{names}element face 2\nproperty list uchar int vertex_indices\nend_header\n"
        + "\n".join([*rows, "3 0 1 2", "3 3 4 5"])
    )
    write_mesh(tmp_path / "out.ply", moved, np.array([[0, 1, 2], [3, 4, 5]]), like=tmp_path / "in.ply")
    lines = (tmp_path / "out.ply").read_text().splitlines()[-8:-2]
    flat, folded = np.array([0, 0, 1.0]), np.array([0, 1, 1]) / np.sqrt(2)
    expected = [flat, flat, flat, folded, folded, folded]
    if (
        not is_creased
    ):  # the angles at the edge's ends: 90 and 90 degrees; 45 degrees and that between an edge and a diagonal
        start, end = flat + folded, np.pi / 4 * flat + np.arctan(np.sqrt(2)) * folded
        expected[0] = expected[4] = start / np.linalg.norm(start)
        expected[1] = expected[3] = end / np.linalg.norm(end)
    found = np.array([[float(word) for word in line.split()[3:]] for line in lines])
    np.testing.assert_allclose(found, expected, atol=1e-6)


# ---------------------------------------------------------------------- OBJ

OBJ = """# Caf\xe9 \\
mtllib my materials.mtl
o part
{v}
vt 0 0.50
vt 1 0.5
vt 0.5 1 0.0
{vn}
g roof left
usemtl Stra\xdfe
s 1
f -7/1{n0} -6/2{n1} -5/3{n2}
f 1/1 3/2 4/3
usemtl other
s off
f 1 4 \\
  5
l 1 2 3
g wall
f 1/2 5/3 6/1
f 1//1 6//1 7//1 # flat
f 1 7 2
"""


def obj(vertices: np.ndarray, **of: str) -> bytes:
    rows = "\n".join(f"v {x!r} {y!r} {z!r} 0.5 {i / 8} 1" for i, (x, y, z) in enumerate(vertices.tolist()))
    return OBJ.format(v=rows, **({"vn": "vn 0 0 1", "n0": "", "n1": "", "n2": ""} | of)).encode("latin-1")


def test_an_obj_keeps_its_lines_in_their_encoding(tmp_path: Path):
    (tmp_path / "in.obj").write_bytes(obj(VERTICES).replace(b"f 1//1 6//1 7//1", b"f 1 6 7"))
    np.testing.assert_array_equal(read_mesh(tmp_path / "in.obj")[1], FACES)
    write_mesh(tmp_path / "out.obj", MOVED, FACES, like=tmp_path / "in.obj")
    assert (tmp_path / "out.obj").read_bytes() == obj(MOVED).replace(b"f 1//1 6//1 7//1", b"f 1 6 7")


def test_windows_line_breaks_of_an_obj_stay(tmp_path: Path):
    (tmp_path / "in.obj").write_bytes(obj(VERTICES).replace(b"f 1//1 6//1 7//1", b"f 1 6 7").replace(b"\n", b"\r\n"))
    write_mesh(tmp_path / "out.obj", MOVED, FACES, like=tmp_path / "in.obj")
    assert (tmp_path / "out.obj").read_bytes().replace(b"\r\n", b"") == obj(MOVED).replace(
        b"f 1//1 6//1 7//1", b"f 1 6 7").replace(b"\n", b"")  # fmt: skip


def test_a_normal_of_an_obj_that_several_vertices_share_becomes_one_for_each(tmp_path: Path):
    """All corners refer to one normal that is right for none of them."""
    faces = "\n".join(f"f {a + 1}/1/1 {b + 1}/2/1 {c + 1}/3/1" for a, b, c in FACES)
    rows = "\n".join(f"v {x} {y} {z}" for x, y, z in VERTICES)
    (tmp_path / "in.obj").write_text(f"{rows}\nvt 0 0\nvt 1 0\nvt 0 1\nvn 0 0 1\n{faces}\n")
    write_mesh(tmp_path / "out.obj", MOVED, FACES, like=tmp_path / "in.obj")
    lines = [line.split() for line in (tmp_path / "out.obj").read_text().splitlines()]
    normals = [[float(word) for word in line[1:]] for line in lines if line[0] == "vn"]
    corners = [[tuple(map(int, word.split("/"))) for word in line[1:]] for line in lines if line[0] == "f"]
    assert [[corner[:2] for corner in face] for face in corners] == [
        [(v + 1, t + 1) for t, v in enumerate(face)] for face in FACES.tolist()
    ]
    expected = angle_weighted(MOVED, FACES)
    for face in corners:
        for v, _, n in face:
            np.testing.assert_allclose(normals[n - 1], expected[v - 1], atol=1e-6)


def test_flat_normals_of_an_obj_stay_one_for_each_face(tmp_path: Path):
    rows = "\n".join(f"v {x} {y} {z}" for x, y, z in VERTICES)
    flat = "\n".join(f"vn 0 0 1\nf {a + 1}//-1 {b + 1}//-1 {c + 1}//-1" for a, b, c in FACES)
    (tmp_path / "in.obj").write_text(f"{rows}\n{flat}\n")
    write_mesh(tmp_path / "out.obj", MOVED, FACES, like=tmp_path / "in.obj")
    lines = (tmp_path / "out.obj").read_text().splitlines()
    assert [line for line in lines if line[:2] == "f "] == [line for line in flat.splitlines() if line[:2] == "f "]
    normals = np.array([[float(word) for word in line.split()[1:]] for line in lines if line[:2] == "vn"])
    np.testing.assert_allclose(normals, trimesh.Trimesh(MOVED, FACES, process=False).face_normals, atol=1e-6)


def test_materials_and_textures_of_an_obj_come_along(tmp_path: Path):
    source, out = tmp_path / "in", tmp_path / "out"
    (source / "maps").mkdir(parents=True)
    out.mkdir()
    (source / "in.obj").write_bytes(obj(VERTICES))
    (source / "my materials.mtl").write_bytes(
        b"newmtl Stra\xdfe\nmap_Kd -s 1 1 1 maps/brick wall.png\nmap_Kd -s 1 1 1 maps/b.jpg\nmap_bump ../secret.png\n"
        b"map_Ks none.png\nmap_Kd in.obj\nbump maps/brick wall.png\n"
    )
    (source / "maps" / "brick wall.png").write_bytes(b"brick")
    (source / "maps" / "b.jpg").write_bytes(b"b")
    (tmp_path / "secret.png").write_bytes(b"secret")
    written = write_mesh(out / "mesh.obj", MOVED, FACES, like=source / "in.obj")
    names = sorted(path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file())
    assert names == ["maps/b.jpg", "maps/brick wall.png", "mesh.obj", "my materials.mtl"]
    assert sorted(path.relative_to(out).as_posix() for path in written) == names
    assert (out / "my materials.mtl").read_bytes() == (source / "my materials.mtl").read_bytes()
    assert (out / "maps" / "brick wall.png").read_bytes() == b"brick"


def test_no_texture_is_copied_out_of_the_output_folder(tmp_path: Path):
    """A link lets a name lead up and stay inside the folder of the mesh, but not inside the output folder."""
    source, out = tmp_path / "in", tmp_path / "deep" / "out"
    (source / "a" / "b").mkdir(parents=True)
    out.mkdir(parents=True)
    (source / "link").symlink_to(source / "a" / "b")
    (source / "c.png").write_bytes(b"c")
    (source / "in.ply").write_bytes(
        text_ply(VERTICES).replace(b"TextureFile photo.png", b"TextureFile link/../../c.png")
    )
    assert write_mesh(out / "out.ply", MOVED, FACES, like=source / "in.ply") == (out / "out.ply",)
    assert sorted(path.name for path in (tmp_path / "deep").rglob("*")) == ["out", "out.ply"]


def test_an_obj_as_ply_keeps_colours_texture_coordinates_and_normals(tmp_path: Path):
    faces = "\n".join(f"f {a + 1}/1/1 {b + 1}/2/1 {c + 1}/3/1" for a, b, c in FACES)
    rows = "\n".join(f"v {x} {y} {z} {i / 10} 0.5 1" for i, (x, y, z) in enumerate(VERTICES))
    (tmp_path / "in.obj").write_text(f"{rows}\nvt 0 0\nvt 1 0\nvt 0 1\nvn 0 0 1\n{faces}\n")
    write_mesh(tmp_path / "out.ply", MOVED, FACES, like=tmp_path / "in.obj")
    np.testing.assert_array_equal(read_mesh(tmp_path / "out.ply")[0], MOVED)
    raw = trimesh.load(tmp_path / "out.ply", process=False, fix_texture=False).metadata["_ply_raw"]
    vertex, face = raw["vertex"]["data"], raw["face"]["data"]
    np.testing.assert_array_equal(np.asarray(vertex["red"]).reshape(-1), np.rint(255 * np.arange(7) / 10))
    np.testing.assert_array_equal(face["texcoord"]["f1"], [[0, 0, 1, 0, 0, 1]] * 6)
    normals = np.column_stack([np.asarray(vertex[name]).reshape(-1) for name in ("nx", "ny", "nz")])
    np.testing.assert_allclose(normals, angle_weighted(MOVED, FACES), atol=1e-6)


# ---------------------------------------------------------------------- OFF, STL


def test_an_off_keeps_colours_and_has_new_normals(tmp_path: Path):
    normals = angle_weighted(VERTICES, FACES)

    def rows(vertices: np.ndarray) -> list[str]:
        return [" ".join(map(repr, v)) for v in vertices.tolist()]

    tail = [f"{' '.join(map(str, n))} {i} 20 30 255 # {i}" for i, n in enumerate(normals.tolist())]
    head = "CNOFF # colours, normals\n7 6 0\n\n"
    faces = "\n".join(f"3 {a} {b} {c} 0.5 0.25 1" for a, b, c in FACES)
    text = head + "\n".join(f"{p} {t}" for p, t in zip(rows(VERTICES), tail, strict=True)) + f"\n{faces}\n"
    (tmp_path / "in.off").write_text(text)
    write_mesh(tmp_path / "out.off", MOVED, FACES, like=tmp_path / "in.off")
    out, expected = (tmp_path / "out.off").read_text().splitlines(), angle_weighted(MOVED, FACES)
    assert out[:3] + out[10:] == text.splitlines()[:3] + text.splitlines()[10:]
    for i, line in enumerate(out[3:10]):
        assert line.split()[:3] == rows(MOVED)[i].split()
        np.testing.assert_allclose([float(word) for word in line.split()[3:6]], expected[i], atol=1e-6)
        assert line.split()[6:] == [str(i), "20", "30", "255", "#", str(i)]
    write_mesh(tmp_path / "out.ply", MOVED, FACES, like=tmp_path / "in.off")
    raw = trimesh.load(tmp_path / "out.ply", process=False).metadata["_ply_raw"]
    assert np.asarray(raw["vertex"]["data"]["red"]).reshape(-1).tolist() == list(range(7))
    assert np.asarray(raw["face"]["data"]["green"]).reshape(-1).tolist() == [64] * 6


def test_an_stl_keeps_its_header_names_and_attributes(tmp_path: Path):
    soup, moved = VERTICES[FACES].reshape(-1, 3), MOVED[FACES].reshape(-1, 3)
    corners = np.arange(18).reshape(-1, 3)
    binary = trimesh.Trimesh(soup, corners, process=False).export(file_type="stl")
    binary = b"colour=7".ljust(80) + binary[80:-2] + b"\x07\x80"
    (tmp_path / "in.stl").write_bytes(binary)
    write_mesh(tmp_path / "out.stl", moved, corners, like=tmp_path / "in.stl")
    out = (tmp_path / "out.stl").read_bytes()
    assert out[:84] == binary[:84]
    assert out[-2:] == b"\x07\x80"
    np.testing.assert_array_equal(read_mesh(tmp_path / "out.stl")[0], moved)
    np.testing.assert_allclose(
        trimesh.load(tmp_path / "out.stl", process=False).face_normals, trimesh.Trimesh(MOVED, FACES, process=False).face_normals,
        atol=1e-6,
    )  # fmt: skip
    facets = [
        "facet normal 0 0 1\n outer loop\n"
        + "".join(f"  vertex {x!r} {y!r} {z!r}\n" for x, y, z in face)
        + " endloop\nendfacet\n"
        for face in VERTICES[FACES].tolist()
    ]
    (tmp_path / "in.stl").write_text(
        f"solid roof\n{facets[0]}endsolid roof\nsolid wall\n{''.join(facets[1:])}endsolid wall\n"
    )
    write_mesh(tmp_path / "out.stl", moved, corners, like=tmp_path / "in.stl")
    assert [line for line in (tmp_path / "out.stl").read_text().splitlines() if "solid" in line] == [
        "solid roof", "endsolid roof", "solid wall", "endsolid wall",
    ]  # fmt: skip
    np.testing.assert_array_equal(read_mesh(tmp_path / "out.stl")[0], moved)


# ---------------------------------------------------------------------- glTF


def textured_glb(path: Path) -> trimesh.Scene:
    """Two parts with texture coordinates, a material and an image; one mesh is shown twice, once mirrored and scaled."""
    image = Image.fromarray(np.arange(48, dtype=np.uint8).reshape(4, 4, 3))
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=image, name="bricks", roughnessFactor=0.25)
    uv = np.random.default_rng(0).uniform(size=(7, 2))
    visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
    mesh = trimesh.Trimesh(VERTICES, FACES, visual=visual, process=False)
    mesh.vertex_normals  # noqa: B018 - computed, so that they are exported
    scene = trimesh.Scene()
    scene.add_geometry(mesh, geom_name="a", node_name="one")
    scene.graph.update("two", geometry="a", matrix=np.diag([-2.0, 2, 2, 1]) + np.eye(4, k=3) * 5)
    scene.export(path, include_normals=True)
    return scene


def glb_content(path: Path) -> dict:
    data = path.read_bytes()
    return json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])


def test_a_glb_keeps_materials_textures_and_nodes(tmp_path: Path):
    textured_glb(tmp_path / "in.glb")
    vertices, faces = read_mesh(tmp_path / "in.glb")
    assert len(vertices) == 14
    moved = vertices + np.random.default_rng(1).normal(0, 0.05, vertices.shape)
    written = write_mesh(tmp_path / "out.glb", moved, faces, like=tmp_path / "in.glb")
    assert written == (tmp_path / "out.glb",)
    found, found_faces = read_mesh(tmp_path / "out.glb")
    # Single precision of coordinates up to 7, moved by 5 and scaled by 2.
    np.testing.assert_allclose(found, moved, atol=2e-6)
    np.testing.assert_array_equal(found_faces, faces)
    before, after = glb_content(tmp_path / "in.glb"), glb_content(tmp_path / "out.glb")
    for key in ("materials", "textures", "images", "scenes", "samplers"):
        assert after.get(key) == before.get(key), key
    assert [node.get("name") for node in after["nodes"]] == [node.get("name") for node in before["nodes"]]
    both = [trimesh.load(tmp_path / name, process=False) for name in ("in.glb", "out.glb")]
    old, new = (scene.to_mesh() for scene in both)
    np.testing.assert_array_equal(old.visual.uv, new.visual.uv)
    assert old.visual.material.name == new.visual.material.name == "bricks"
    np.testing.assert_array_equal(*(np.asarray(m.visual.material.baseColorTexture) for m in (old, new)))
    # trimesh, as another reader, puts both copies where they were asked to be.
    ours = {tuple(t.ravel()) for t in np.round(moved[faces], 4)}
    theirs = {tuple(t.ravel()) for t in np.round(new.vertices[new.faces], 4)}
    assert {tuple(sorted(map(tuple, np.reshape(t, (3, 3)).tolist()))) for t in ours} == {
        tuple(sorted(map(tuple, np.reshape(t, (3, 3)).tolist()))) for t in theirs
    }


def test_normals_of_a_glb_are_computed_anew(tmp_path: Path):
    mesh = trimesh.Trimesh(VERTICES, FACES, process=False)
    mesh.vertex_normals  # noqa: B018
    trimesh.Scene(mesh).export(tmp_path / "in.glb", include_normals=True)
    write_mesh(tmp_path / "out.glb", MOVED, FACES, like=tmp_path / "in.glb")
    (found,) = trimesh.load(tmp_path / "out.glb", process=False).geometry.values()
    np.testing.assert_allclose(found.vertex_normals, angle_weighted(MOVED, FACES), atol=1e-6)
    write_mesh(tmp_path / "out.ply", MOVED, FACES, like=tmp_path / "in.glb")
    raw = trimesh.load(tmp_path / "out.ply", process=False).metadata["_ply_raw"]["vertex"]["data"]
    normals = np.column_stack([np.asarray(raw[name]).reshape(-1) for name in ("nx", "ny", "nz")])
    np.testing.assert_allclose(normals, angle_weighted(MOVED, FACES), atol=1e-6)


def test_a_gltf_is_written_as_glb_with_its_images_beside_it(tmp_path: Path):
    source, out = tmp_path / "in", tmp_path / "out"
    source.mkdir()
    out.mkdir()
    textured_glb(tmp_path / "in.glb")
    for name, data in trimesh.load(tmp_path / "in.glb", process=False).export(file_type="gltf").items():
        (source / name).write_bytes(data)
    header = json.loads((source / "model.gltf").read_text())
    header["images"] = [{"uri": "brick%20wall.png"}]
    (source / "brick wall.png").write_bytes(b"brick")
    (source / "model.gltf").write_text(json.dumps(header))
    vertices, faces = read_mesh(source / "model.gltf")
    written = write_mesh(out / "mesh.glb", vertices + 0.5, faces, like=source / "model.gltf")
    assert [path.name for path in written] == ["mesh.glb", "brick wall.png"]
    np.testing.assert_allclose(read_mesh(out / "mesh.glb")[0], vertices + 0.5, atol=2e-6)


# ---------------------------------------------------------------------- what `fair` writes


def scene_of(path: Path) -> Scene:
    scene = corner_scene()
    vertices, faces = read_mesh(path)
    return replace(Scene.build("corner", vertices, faces, scene.views), mesh_file=path)


def test_a_run_on_an_obj_writes_a_ply_and_an_obj(tmp_path: Path):
    (tmp_path / "in.obj").write_bytes(obj(VERTICES))
    scene = scene_of(tmp_path / "in.obj")
    out = tmp_path / "out"
    out.mkdir()
    (out / "mesh.glb").write_bytes(b"of an earlier run")
    written = write_refined_mesh(out / "mesh.ply", scene, scene.mesh.vertices + 0.125)
    assert [path.name for path in written.files] == ["mesh.ply", "mesh.obj"]
    assert sorted(path.name for path in out.iterdir()) == ["mesh.obj", "mesh.ply"]
    for name in ("mesh.ply", "mesh.obj"):
        np.testing.assert_array_equal(read_mesh(out / name)[0], VERTICES + 0.125)
        np.testing.assert_array_equal(read_mesh(out / name)[1], FACES)


@pytest.mark.parametrize("change", ["gone", "other"])
def test_a_run_whose_start_mesh_has_changed_is_written_without_its_attributes(tmp_path: Path, change: str):
    """Hours of work are not lost because a file has gone."""
    (tmp_path / "in.ply").write_bytes(text_ply(VERTICES))
    scene = scene_of(tmp_path / "in.ply")
    if change == "gone":
        (tmp_path / "in.ply").unlink()
    else:
        write_mesh(tmp_path / "in.ply", VERTICES, FACES[:5])
    written = write_refined_mesh(tmp_path / "mesh.ply", scene, scene.mesh.vertices + 0.125)
    assert len(written.notes) == 1
    assert "without the attributes" in written.notes[0]
    np.testing.assert_array_equal(read_mesh(tmp_path / "mesh.ply")[0], VERTICES + 0.125)


def test_a_mesh_like_another_one_must_have_its_faces_and_a_format_that_holds_it(tmp_path: Path):
    (tmp_path / "in.ply").write_bytes(text_ply(VERTICES))
    with pytest.raises(
        InputError, match=r"in\.ply: expected the mesh that was refined .7 vertices, 5 faces.*found another"
    ):
        write_mesh(tmp_path / "out.ply", MOVED, FACES[:5], like=tmp_path / "in.ply")
    with pytest.raises(InputError, match=r"out\.obj: a mesh like in\.ply is written as \.ply"):
        write_mesh(tmp_path / "out.obj", MOVED, FACES, like=tmp_path / "in.ply")
    assert [path.name for path in tmp_path.iterdir()] == ["in.ply"]


# ---------------------------------------------------------------------- polygons


def polygon_file(name: str, faces: list[tuple[int, ...]], vertices: np.ndarray) -> bytes:
    """Six vertices and faces with texture coordinates and a label for each; the last face has another label."""
    labels = [7] * (len(faces) - 1) + [8]
    uv = [(c / 8, c / 4) for c in range(6)]
    rows = [" ".join(map(repr, point)) for point in vertices.tolist()]
    indices = [" ".join(map(str, face)) for face in faces]
    coordinates = [[x for c in face for x in uv[c]] for face in faces]
    of_faces = list(zip(faces, indices, coordinates, labels, strict=True))
    if name == "m.obj":
        lines = [*(f"v {row}" for row in rows), *(f"vt {u} {v}" for u, v in uv)]
        lines += [f"f {' '.join(f'{c + 1}/{c + 1}' for c in face)}" for face in faces]
        return "\n".join([*lines, ""]).encode()
    if name == "m.off":
        lines = ["OFF", f"6 {len(faces)} 0", *rows]
        return "\n".join([*lines, *(f"{len(f)} {of} {label} 0 0" for f, of, _, label in of_faces), ""]).encode()
    form = "ascii" if name == "text.ply" else "binary_big_endian"
    header = [f"ply\nformat {form} 1.0\nelement vertex 6", *(f"property double {axis}" for axis in "xyz")]
    header += [
        f"element face {len(faces)}",
        "property list uchar int vertex_indices",
        "property list uchar float texcoord",
    ]
    header += ["property uchar label", "end_header"]
    if name == "text.ply":
        lines = [f"{len(f)} {of} {2 * len(f)} {' '.join(map(str, t))} {label}" for f, of, t, label in of_faces]
        return "\n".join([*header, *rows, *lines, ""]).encode()
    items = [struct.pack(f">B{len(f)}iB{len(t)}fB", len(f), *f, len(t), *t, label) for f, _, t, label in of_faces]
    return "\n".join([*header, ""]).encode() + vertices.astype(">f8").tobytes() + b"".join(items)


@pytest.mark.parametrize("name", ["text.ply", "binary.ply", "m.obj", "m.off"])
def test_a_polygon_stays_one_unless_it_would_be_read_as_other_triangles(tmp_path: Path, name: str):
    """Corner 1 lies in the middle of a side, which ear clipping heeds; moved outwards, the polygon is convex."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [3, 1, 0.0]])
    whole, last = (0, 1, 2, 3, 4), (5, 3, 2)
    (tmp_path / name).write_bytes(polygon_file(name, [whole, last], vertices))
    found, faces = read_mesh(tmp_path / name)
    np.testing.assert_array_equal(found, vertices)
    assert len(faces) == 4
    out = tmp_path / f"out{Path(name).suffix}"
    write_mesh(out, vertices + 0.5, faces, like=tmp_path / name)
    assert out.read_bytes() == polygon_file(name, [whole, last], vertices + 0.5)
    moved = vertices.copy()
    moved[1, 1] = -0.5
    write_mesh(out, moved, faces, like=tmp_path / name)
    np.testing.assert_array_equal(read_mesh(out)[1], faces)
    assert out.read_bytes() == polygon_file(name, [tuple(face) for face in faces.tolist()], moved)
