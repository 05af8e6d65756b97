"""Seeds: small valid inputs in every format, and what reads them."""

import json
import shutil
import struct
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from PIL import Image

from app.debugger.bookmarks import Bookmarks, read_bookmarks, write_bookmarks
from app.files.scene_source import SceneSource
from fairing.check.scene_check import check_scene
from fairing.io import load_scene, read_mesh, write_mesh
from fairing.io.mesh_file import own_suffix
from fairing.io.points_file import write_points
from fairing.io.scan_file import read_matches, read_scan, write_scan
from fairing.mesh import Mesh
from fairing.options import options_from_dict
from fairing.photo import FilePhoto, Mask
from fairing.registration.alignment import register_matches
from fairing.run.history import History
from fairing.run.phases import schedule_of
from fairing.scene import Scene, SparsePoints
from fairing.trace import Trace
from fairing.triangulation import FlipTrace
from tests.foreign_formats import WRITERS, ForeignCapture, write_scene, write_scene_json
from tests.program_formats import PROGRAM_WRITERS, write_metashape, write_nerfstudio_lens, write_nvm
from tests.record_files import flip, run_header, split_round, step, write_flips, write_trace
from tests.synthetic_capture import CUBE_FACES, CUBE_VERTICES, HEIGHT, WIDTH, SyntheticCapture

_CHECKED = 0.25
"""Share of the scenes that are also checked as `eigenfairing check` does, which takes longer than loading."""


@dataclass(frozen=True)
class Seed:
    """A valid input.

    Attributes:
        folder: holds its files.
        files: those that are mutated, relative to the folder.
        use: reads the input; with a random number in 0 to 1 for what is done only sometimes.
    """

    name: str
    folder: Path
    files: tuple[str, ...]
    use: Callable[[Path, float], object]


def make_seeds(folder: Path) -> list[Seed]:
    """All seeds, written below a folder."""
    seeds = [*_scenes(folder), *_meshes(folder), *_photos(folder), *_scans(folder), *_records(folder)]
    assert len({seed.name for seed in seeds}) == len(seeds)
    return seeds


# ---------------------------------------------------------------------- scenes

_FILES = {
    "COLMAP": ("sparse/cameras.txt", "sparse/images.txt", "sparse/points3D.txt"),
    "nerfstudio": ("transforms.json",),
    "NeRF": ("transforms.json",),
    "Middlebury": ("small_par.txt",),
    "Strecha": ("b.png.camera", "a.png.camera"),
    "Bundler": ("bundle.out", "list.txt"),
    "OpenMVG": ("sfm_data.json",),
    "Meshroom": ("cameras.sfm",),
    "matrices": ("cameras/b.txt", "cameras/a.txt"),
    "OpenSfM": ("reconstruction.json", "tracks.csv"),
    "VisualSFM": ("scene.nvm",),
    "Metashape": ("cameras.xml",),
    "RealityScan": ("cameras.csv",),
}
_LENSES = {
    "Bundler": (-0.1, 0.01, 0.0, 0.0, 0.0),
    "matrices": (0.0,) * 5,
    "Middlebury": (0.0,) * 5,
    "Strecha": (0.0,) * 5,
    "NeRF": (0.0,) * 5,
}


_K4 = {"k1": -0.1, "k2": 0.01, "k3": 0.002, "k4": 0.001}
_APPLIED: dict[str, Any] = {
    "applied_transform": np.eye(4)[:3].tolist(),
    "applied_scale": 0.5,
    "ply_file_path": "sparse/points.ply",
}


def _scenes(folder: Path) -> list[Seed]:
    seeds = []
    for name, files in _FILES.items():
        lens = _LENSES.get(name, (-0.1, 0.01, 0.001, -0.001, 0.002))
        writer = (WRITERS | PROGRAM_WRITERS)[name]
        seeds.append(
            Seed(name, write_scene(ForeignCapture(n_points=6, lens=lens), folder / name, writer), files, _use_scene)
        )
    for model in ("PINHOLE", "OPENCV"):
        binary = folder / f"COLMAP binary {model}"
        capture = SyntheticCapture(model, n_points=6)
        capture.write_photos(binary / "images")
        capture.write_mesh(binary / "mesh.obj")
        capture.write_binary(binary / "sparse")
        files = ("sparse/cameras.bin", "sparse/images.bin", "sparse/points3D.bin")
        seeds.append(Seed(f"COLMAP binary {model}", binary, files, _use_scene))
    seeds += _lenses(folder)
    seeds.append(_own_scene(folder / "scene.json"))
    return seeds


def _lenses(folder: Path) -> list[Seed]:
    """Lenses that are no polynomials of OpenCV, and everything that a nerfstudio file can name."""
    capture = ForeignCapture(n_points=6)
    writers = {
        "nerfstudio fisheye": (partial(write_nerfstudio_lens, model="OPENCV_FISHEYE", lens=_K4), "transforms.json"),
        "nerfstudio k4": (partial(write_nerfstudio_lens, model="OPENCV", lens=_K4 | _APPLIED), "transforms.json"),
        "VisualSFM FixedK": (partial(write_nvm, r1=0.1, fixed=True), "scene.nvm"),
        "Metashape fisheye": (
            partial(write_metashape, kind="fisheye", lens=_K4 | {"b1": 1.0, "b2": 2.0}),
            "cameras.xml",
        ),
    }
    seeds = [
        Seed(name, write_scene(capture, folder / name, writer), (file,), _use_scene)
        for name, (writer, file) in writers.items()
    ]
    (folder / "nerfstudio k4" / "sparse").mkdir()  # beside the mesh it would be a second one
    write_scan(folder / "nerfstudio k4" / "sparse" / "points.ply", capture.points)
    return seeds


def _own_scene(folder: Path) -> Seed:
    """With everything that the format can name."""
    capture = ForeignCapture(n_points=6)
    write_scene(capture, folder, write_scene_json)
    content = json.loads((folder / "scene.json").read_text())
    content |= {"mesh": "mesh.obj", "points": "points.npz"}
    view = content["views"][1]
    view |= {"image_from_world": capture.matrix(1).tolist(), "mask": "mask.png", "weight": 0.5}
    for key in ("K", "R", "t"):
        del view[key]
    (folder / "scene.json").write_text(json.dumps(content))
    Image.fromarray(np.full((HEIGHT, WIDTH), 255, np.uint8)).save(folder / "mask.png")
    observations = np.stack(np.meshgrid(np.arange(6), np.arange(4)), axis=-1).reshape(-1, 2)
    pixels = np.stack([capture.pixels[v][p] for p, v in observations.tolist()])
    write_points(folder / "points.npz", SparsePoints(capture.points, np.zeros((6, 3), np.uint8), observations, pixels))
    return Seed("scene.json", folder, ("scene.json", "points.npz", "mask.png"), _use_scene)


def _use_scene(folder: Path, chance: float) -> Scene:
    scene = load_scene(folder)
    for view in scene.views[:2]:
        view.photo.load()
        if view.mask is not None:
            view.mask.load()
    if chance < _CHECKED:
        check_scene(scene)
    return scene


# ---------------------------------------------------------------------- single files


def _meshes(folder: Path) -> list[Seed]:
    seeds = []
    mesh = trimesh.Trimesh(CUBE_VERTICES, CUBE_FACES, process=False)
    for suffix in ("ply", "obj", "off", "stl", "glb", "gltf"):
        own = folder / suffix
        own.mkdir(parents=True)
        files = (f"mesh.{suffix}",)
        if suffix == "gltf":
            exported = trimesh.Scene(mesh).export(file_type="gltf")
            for name, data in exported.items():
                (own / name.replace("model", "mesh")).write_bytes(data)
            files = tuple(sorted(path.name for path in own.iterdir()))
        else:
            mesh.export(own / f"mesh.{suffix}")
        seeds.append(Seed(f"mesh {suffix}", own, files, lambda path, _, name=f"mesh.{suffix}": _use_mesh(path / name)))
    ascii_ply = folder / "ascii ply"
    ascii_ply.mkdir()
    (ascii_ply / "mesh.ply").write_bytes(mesh.export(file_type="ply", encoding="ascii"))
    seeds.append(Seed("mesh ascii ply", ascii_ply, ("mesh.ply",), lambda path, _: _use_mesh(path / "mesh.ply")))
    for name, content in _RICH.items():
        own = folder / f"rich {name}"
        own.mkdir()
        (own / f"mesh.{name}").write_bytes(content)
        seeds.append(
            Seed(
                f"mesh rich {name}", own, (f"mesh.{name}",), lambda path, _, name=f"mesh.{name}": _use_mesh(path / name)
            )
        )
    return seeds


_SQUARE = struct.pack("<12f", 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0)
_RICH = {
    "ply": (
        b"ply\nformat binary_little_endian 1.0\ncomment TextureFile a.png\nelement vertex 4\nproperty float x\nproperty float y\n"
        b"property float z\nelement face 2\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\n"
        b"property float nx\nproperty float ny\nproperty float nz\nelement tristrips 1\nproperty list int int vertex_indices\n"
        b"end_header\n"
        + _SQUARE
        + struct.pack("<B4iB8f3f", 4, 0, 1, 2, 3, 8, *range(8), 0, 0, 1)
        + struct.pack("<B3iB6f3f", 3, 0, 1, 2, 6, *range(6), 0, 0, 1)
        + struct.pack("<6i", 5, 0, 1, 3, -1, 2)
    ),
    "obj": (
        b"mtllib a.mtl\nv 0 0 0 1 0 0\nv 2 0 0 0 1 0\nv 1 0.5 0 0 0 1\nv 1 2 0 1 1 1\nvt 0 0\nvt 1 0\nvn 0 0 1\ng a b\nusemtl m\n"
        b"f -4/1/1 -3/2/1 -2/1/1 -1/2/1\nf 1//1 2//1 \\\n 4//1\nf 1/1 2/2 3/1\n"
    ),
    "off": b"CNOFF\n4 2 0\n" + b"".join(b"%d %d 0 0 0 1 9 9 9 255\n" % xy for xy in ((0, 0), (2, 0), (1, 1), (0, 2)))
    + b"4 0 1 2 3 0.5 0.5 0.5\n3 0 1 2 0 0 0 # last\n",
}  # fmt: skip


def _use_mesh(path: Path) -> None:
    """Read a mesh, and write another one with its attributes in its own format and as PLY."""
    vertices, faces = read_mesh(path)
    Mesh(vertices, faces)
    for suffix in {own_suffix(path), ".ply"}:
        write_mesh(path.with_name(f"written{suffix}"), vertices + 0.5, faces, like=path)


def _photos(folder: Path) -> list[Seed]:
    seeds = []
    pixels = np.random.default_rng(0).integers(0, 256, (18, 24, 3), dtype=np.uint8)
    for suffix in ("png", "jpg", "tif", "bmp", "webp", "ppm"):
        own = folder / suffix
        own.mkdir(parents=True)
        name = f"photo.{suffix}"
        Image.fromarray(pixels).save(own / name)
        seeds.append(Seed(f"photo {suffix}", own, (name,), lambda path, _, name=name: _use_photo(path / name)))
    return seeds


def _use_photo(path: Path) -> None:
    FilePhoto(path).load()
    Mask(path).load()


def _scans(folder: Path) -> list[Seed]:
    own = folder / "scan"
    capture = ForeignCapture(n_points=6)
    write_scene(capture, own / "scene", "scene.json")
    lines = [" ".join(map(repr, (*point, *point))) for point in capture.points.tolist()[:4]]
    for p, point in enumerate(capture.points.tolist()[4:], start=4):
        seen = (
            f"{name} {capture.pixels[i][p][0]!r} {capture.pixels[i][p][1]!r}" for i, name in enumerate(capture.names)
        )
        lines.append(
            " ".join([*map(repr, point), *(word.replace("np.float64(", "").replace(")", "") for word in seen)])
        )
    (own / "matches.txt").write_text("# scan, then world or photos\n" + "\n".join(lines) + "\n")
    trimesh.PointCloud(CUBE_VERTICES).export(own / "scan.ply")
    np.savetxt(own / "scan.xyz", CUBE_VERTICES)
    trimesh.Trimesh(CUBE_VERTICES, CUBE_FACES, process=False).export(own / "scan.obj")
    views = load_scene(own / "scene").views

    def use_matches(path: Path, _: float) -> object:
        return register_matches(read_matches(path / "matches.txt", views), views)

    seeds = [Seed("matches", own, ("matches.txt",), use_matches)]
    for suffix in ("ply", "xyz", "obj"):
        name = f"scan.{suffix}"
        seeds.append(Seed(name, own, (name,), lambda path, _, name=name: read_scan(path / name)))
    return seeds


def _records(folder: Path) -> list[Seed]:
    own = folder / "records"
    own.mkdir()
    header = run_header()
    SceneSource("cube").note_in(header)
    write_trace(own / "run.trace", header, [step(), step(sweep_moment=np.array(1)), step(sweep_moment=np.array(0))])
    write_flips(own / "mesh.flips", header, [flip()], [split_round()])
    bookmarks = Bookmarks().added(1, 0, "1:1:1:1", "start").added(1, 2, "1:1:1:2", "two")
    write_bookmarks(own / "run.bookmarks.json", bookmarks.items)
    return [
        Seed("trace", own, ("run.trace",), lambda path, _: _use_trace(path / "run.trace")),
        Seed("flips", own, ("mesh.flips",), lambda path, _: _use_flips(path / "mesh.flips")),
        Seed("bookmarks", own, ("run.bookmarks.json",), lambda path, _: read_bookmarks(path / "run.bookmarks.json", 9)),
    ]


def _use_trace(path: Path) -> None:
    trace = Trace.load(path)
    plan = trace.plan
    history = History(trace, schedule_of(options_from_dict(trace.header["options"]), plan)) if plan else None
    for moment in range(len(trace) + 1):
        trace.vertices_at(moment)
        if history is not None:
            history.origin_at(moment)
    for record in trace.steps:
        assert record.energy_before < np.inf
    SceneSource.of_run(trace.header, path)


def _use_flips(path: Path) -> None:
    trace = FlipTrace.load(path)
    for moment in range(len(trace) + 1):
        trace.faces_at(moment)
    assert all(record.reason for record in trace.flips)
    assert all(len(done.result()[0]) == len(done.after) for done in trace.splits)
    SceneSource.of_run(trace.header, path)


def copy_for_case(seed: Seed, folder: Path) -> Path:
    """A copy of the seed's folder whose files may be changed; those that stay are linked."""
    if folder.exists():
        shutil.rmtree(folder)
    shutil.copytree(seed.folder, folder, copy_function=_link)
    return folder


def _link(source: str, target: str) -> None:
    Path(target).hardlink_to(source)
