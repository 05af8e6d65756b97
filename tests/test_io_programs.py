"""Cameras of other programs: every lens is proved by the reprojection of known points, projected as its program does it."""

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from xml.etree.ElementTree import tostring

import numpy as np
import pytest

from fairing.errors import InputError
from fairing.io import load_scene, read_capture
from fairing.io.capture import Capture
from fairing.photo import FilePhoto
from tests.foreign_formats import ForeignCapture, write_scene
from tests.program_formats import (
    PROGRAM_WRITERS,
    ProgramCapture,
    brown,
    fisheye,
    measured_radial,
    metashape,
    metashape_frame,
    opensfm,
    radius2,
    write_colmap_lens,
    write_meshroom_fisheye,
    write_metashape,
    write_nerfstudio_lens,
    write_nvm,
    write_openmvg_fisheye,
    write_opensfm,
    write_realityscan,
)
from tests.synthetic_capture import HEIGHT, WIDTH

MAX_ERROR = 0.01  # px, as the guide to captures states
PLAIN = ForeignCapture()
OFF_MIDDLE = (50.2, 34.9)
Write = Callable[[ForeignCapture, Path], None]

K4 = {"k1": -0.1, "k2": 0.06, "k3": -0.03, "k4": 0.02}
TANGENTIAL = {"p1": 0.004, "p2": -0.003}
FISHEYE = (0.03, -0.02, 0.01, -0.004)
FOUR = (-0.1, 0.06, -0.03, 0.02)
LENSES: dict[str, tuple[ProgramCapture, Write]] = {
    "OpenSfM perspective": (
        ProgramCapture(distort=brown(-0.12, 0.05, 0, 0, 0)),
        partial(write_opensfm, kind="perspective", lens={"k1": -0.12, "k2": 0.05}),
    ),
    "OpenSfM simple_radial": (
        ProgramCapture(distort=brown(-0.12, 0, 0, 0, 0), center=OFF_MIDDLE),
        partial(write_opensfm, kind="simple_radial", lens={"k1": -0.12}),
    ),
    "OpenSfM radial": (
        ProgramCapture(distort=brown(-0.12, 0.05, 0, 0, 0), center=OFF_MIDDLE),
        partial(write_opensfm, kind="radial", lens={"k1": -0.12, "k2": 0.05}),
    ),
    "OpenSfM brown": (
        ProgramCapture(distort=brown(-0.12, 0.05, -0.01, 0.004, -0.003), center=OFF_MIDDLE),
        partial(write_opensfm, lens={"k1": -0.12, "k2": 0.05, "k3": -0.01, **TANGENTIAL}),
    ),
    "OpenSfM fisheye": (
        ProgramCapture(distort=fisheye(0.03, -0.02)),
        partial(write_opensfm, kind="fisheye", lens={"k1": 0.03, "k2": -0.02}),
    ),
    "OpenSfM fisheye_opencv": (
        ProgramCapture(distort=fisheye(*FISHEYE), center=OFF_MIDDLE),
        partial(write_opensfm, kind="fisheye_opencv", lens=dict(zip(("k1", "k2", "k3", "k4"), FISHEYE, strict=True))),
    ),
    "VisualSFM barrel": (ProgramCapture(distort=measured_radial(0.15)), partial(write_nvm, r1=0.15)),
    "VisualSFM pincushion": (ProgramCapture(distort=measured_radial(-0.15)), partial(write_nvm, r1=-0.15)),
    "VisualSFM FixedK": (
        ProgramCapture(distort=measured_radial(0.1), center=OFF_MIDDLE),
        partial(write_nvm, r1=0.1, fixed=True),
    ),
    "Metashape frame": (
        ProgramCapture(distort=metashape_frame(FOUR, 0.004, -0.003), center=OFF_MIDDLE, skew=1.3, stretch=-2.0),
        partial(write_metashape, lens={"b1": -2.0, "b2": 1.3, **K4, **TANGENTIAL}),
    ),
    "Metashape fisheye": (
        ProgramCapture(distort=fisheye(*FISHEYE), center=OFF_MIDDLE, skew=-0.7, stretch=1.0),
        partial(
            write_metashape,
            kind="fisheye",
            lens={"b1": 1.0, "b2": -0.7, **dict(zip(("k1", "k2", "k3", "k4"), FISHEYE, strict=True))},
        ),
    ),
    "RealityScan": (
        # RealityScan's t1 multiplies r^2 + 2 x^2, as Metashape's p1.
        ProgramCapture(distort=metashape_frame(FOUR, 0.004, -0.003), center=OFF_MIDDLE),
        partial(write_realityscan, lens={**K4, "t1": 0.004, "t2": -0.003}),
    ),
    "COLMAP OPENCV_FISHEYE": (
        ProgramCapture(distort=fisheye(*FISHEYE), center=OFF_MIDDLE),
        partial(write_colmap_lens, model="OPENCV_FISHEYE", lens=FISHEYE),
    ),
    "COLMAP RADIAL_FISHEYE": (
        ProgramCapture(distort=fisheye(0.03, -0.02), center=OFF_MIDDLE),
        partial(write_colmap_lens, model="RADIAL_FISHEYE", lens=(0.03, -0.02)),
    ),
    "COLMAP SIMPLE_RADIAL_FISHEYE": (
        ProgramCapture(distort=fisheye(0.03), center=OFF_MIDDLE),
        partial(write_colmap_lens, model="SIMPLE_RADIAL_FISHEYE", lens=(0.03,)),
    ),
    "COLMAP FISHEYE": (
        ProgramCapture(distort=fisheye(), center=OFF_MIDDLE),
        partial(write_colmap_lens, model="FISHEYE", lens=()),
    ),
    "COLMAP SIMPLE_DIVISION": (
        # m / (1 + k m^2) = ray: m = (1 - sqrt(1 - 4 k r^2)) / (2 k r) along the ray.
        ProgramCapture(
            distort=lambda rays: rays * (1 - np.sqrt(1 + 0.8 * radius2(rays))) / (-0.4 * radius2(rays)),
            center=OFF_MIDDLE,
        ),
        partial(write_colmap_lens, model="SIMPLE_DIVISION", lens=(-0.2,)),
    ),
    "nerfstudio OPENCV_FISHEYE": (
        ProgramCapture(distort=fisheye(*FISHEYE), center=OFF_MIDDLE),
        partial(
            write_nerfstudio_lens,
            model="OPENCV_FISHEYE",
            lens=dict(zip(("k1", "k2", "k3", "k4"), FISHEYE, strict=True)),
        ),
    ),
    "nerfstudio k4": (
        # nerfstudio's p1 and p2 are OpenCV's.
        ProgramCapture(distort=metashape_frame(FOUR, -0.003, 0.004), center=OFF_MIDDLE),
        partial(write_nerfstudio_lens, model="OPENCV", lens={**K4, **TANGENTIAL}),
    ),
    "Meshroom fisheye4": (
        ProgramCapture(distort=fisheye(*FISHEYE), center=OFF_MIDDLE),
        partial(write_meshroom_fisheye, lens=FISHEYE),
    ),
    "OpenMVG fisheye": (
        ProgramCapture(distort=fisheye(*FISHEYE), center=OFF_MIDDLE),
        partial(write_openmvg_fisheye, lens=FISHEYE),
    ),
}


def reprojection_error(capture: Capture, truth: ProgramCapture) -> float:
    """Pixels: the largest distance of a known point from where its distorted pixel is undistorted to."""
    errors = []
    for i, view in enumerate(capture.views):
        assert isinstance(view.photo, FilePhoto)
        assert view.photo.lens is not None
        inside = ((truth.pixels[i] > 0) & (truth.pixels[i] < (WIDTH - 1, HEIGHT - 1))).all(axis=1)
        straight = view.photo.lens.undistort(truth.pixels[i][inside])
        expected, depth = view.camera.project(truth.points[inside])
        seen = ((expected > 0) & (expected < (WIDTH - 1, HEIGHT - 1))).all(axis=1)
        assert seen.sum() > 20
        assert depth.min() > 0
        errors.append(np.abs(straight - expected)[seen].max())
    return float(max(errors))


@pytest.mark.parametrize("name", LENSES)
def test_known_points_are_reprojected_through_every_lens(tmp_path: Path, name: str, record_property):
    truth, write = LENSES[name]
    capture = read_capture(write_scene(truth, tmp_path / "scene", write))
    assert [view.name for view in capture.views] == list(truth.names)
    error = reprojection_error(capture, truth)
    record_property("largest reprojection error, px", error)
    assert error < MAX_ERROR, f"{error:.2g} px"


@pytest.mark.parametrize("name", [name for name in LENSES if not name.startswith(("Metashape", "RealityScan", "nerf"))])
def test_observations_of_points_lie_where_the_undistorted_photos_show_them(tmp_path: Path, name: str):
    truth, write = LENSES[name]
    capture = read_capture(write_scene(truth, tmp_path / "scene", write))
    points = capture.sparse_points
    assert points is not None
    assert len(points.positions) == len(truth.points)
    assert len(points.observations) > 100
    for v, view in enumerate(capture.views):
        mine = points.observations[:, 1] == v
        pixels, _ = view.camera.project(points.positions[points.observations[mine, 0]])
        seen = ((pixels > 0) & (pixels < (WIDTH - 1, HEIGHT - 1))).all(axis=1)
        assert np.abs(pixels - points.pixels[mine])[seen].max() < MAX_ERROR


@pytest.mark.parametrize("name", PROGRAM_WRITERS)
def test_the_scene_projects_alike_through_every_program(tmp_path: Path, name: str):
    scene = load_scene(write_scene(PLAIN, tmp_path / "scene", PROGRAM_WRITERS[name]))
    assert [view.name for view in scene.views] == list(PLAIN.names)
    for i, view in enumerate(scene.views):
        np.testing.assert_allclose(view.camera.image_from_world, PLAIN.matrix(i), rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", PROGRAM_WRITERS)
def test_photos_are_found_beside_the_cameras_and_one_folder_up(tmp_path: Path, name: str):
    folder = write_scene(PLAIN, tmp_path / "scene", PROGRAM_WRITERS[name])
    (folder / "export").mkdir()
    for file in folder.iterdir():
        if file.suffix in (".json", ".nvm", ".xml", ".csv"):
            file.rename(folder / "export" / file.name)
    if name != "VisualSFM":  # whose files stand beside the photos
        assert len(read_capture(folder / "export").views) == 4
    (folder / "images").rename(folder / "export" / "photos")
    assert len(read_capture(folder / "export").views) == 4


def test_the_largest_reconstruction_of_opensfm_is_read(tmp_path: Path):
    def write(capture: ForeignCapture, folder: Path) -> None:
        (whole,) = opensfm(capture)
        part = whole | {"shots": dict(list(whole["shots"].items())[:2])}
        (folder / "opensfm").mkdir()
        (folder / "opensfm" / "reconstruction.json").write_text(json.dumps([part, whole]))

    capture = read_capture(write_scene(PLAIN, tmp_path / "scene", write))
    assert len(capture.views) == 4
    assert capture.warnings == ("further reconstructions are not read: 1 (2 photos)",)
    assert capture.sparse_points is not None
    assert len(capture.sparse_points.observations) == 0  # there are no tracks


def test_file_names_with_spaces_are_found_as_visualsfm_writes_them(tmp_path: Path):
    capture = ForeignCapture(names=("a b.png", "b b.png", "c.png", "d.png"))
    folder = write_scene(capture, tmp_path / "scene", write_nvm)
    text = (folder / "scene.nvm").read_text()
    (folder / "scene.nvm").write_text(text.replace("a b.png", 'a"b.png'))
    assert [view.name for view in read_capture(folder).views] == list(capture.names)


def test_metashape_cameras_lie_where_the_chunks_transform_puts_them(tmp_path: Path):
    turn = PLAIN.R(2)
    similarity = np.eye(4)
    similarity[:3, :3], similarity[:3, 3] = 12.5 * turn, (400_000.0, -30.0, 7.0)
    folder = write_scene(PLAIN, tmp_path / "scene", partial(write_metashape, similarity=similarity))
    capture = read_capture(folder)
    for i, view in enumerate(capture.views):
        pixels, expected = (camera_pixels(P, PLAIN.points) for P in (view.camera.image_from_world, PLAIN.matrix(i)))
        # 400,000 units have 6e-11 units of rounding, and a unit measures 16 px.
        np.testing.assert_allclose(pixels, expected, rtol=0, atol=1e-6)
    (frame,) = capture.frames
    assert "before the chunk's transform" in frame.name
    np.testing.assert_allclose(frame.linear, similarity[:3, :3])
    np.testing.assert_allclose(frame.shift, similarity[:3, 3])


def camera_pixels(P: np.ndarray, points: np.ndarray) -> np.ndarray:
    homogeneous = points @ P[:, :3].T + P[:, 3]
    return homogeneous[:, :2] / homogeneous[:, 2:]


def test_metashape_cameras_that_are_disabled_or_not_aligned_are_left_out(tmp_path: Path):
    def write(capture: ForeignCapture, folder: Path) -> None:
        root = metashape(capture)
        cameras = {camera.get("label"): camera for camera in root.iter("camera")}
        cameras["a"].set("enabled", "false")
        transform = cameras["b"].find("transform")
        assert transform is not None
        cameras["b"].remove(transform)
        (folder / "cameras.xml").write_bytes(tostring(root))

    capture = read_capture(write_scene(PLAIN, tmp_path / "scene", write))
    assert [view.name for view in capture.views] == ["c.png", "d.png"]
    assert "photos left out, disabled: 1 (a)" in capture.warnings
    assert "photos left out, without a pose: 1 (b)" in capture.warnings


def test_nerfstudio_names_its_points_and_the_transform_it_applied(tmp_path: Path):
    applied = [[0.0, 0, 1, 3], [1, 0, 0, -2], [0, 1, 0, 1]]
    lens = {"ply_file_path": "sparse_pc.ply", "applied_transform": applied, "applied_scale": 0.5}

    def write(capture: ForeignCapture, folder: Path) -> None:
        write_nerfstudio_lens(capture, folder, "OPENCV", lens)
        rows = "".join(f"{x!r} {y!r} {z!r} 1 2 3\n" for x, y, z in capture.points.tolist())
        header = f"ply\nformat ascii 1.0\nelement vertex {len(capture.points)}\n"
        header += "".join(f"property double {axis}\n" for axis in "xyz")
        header += "".join(f"property uchar {channel}\n" for channel in ("red", "green", "blue")) + "end_header\n"
        (folder / "sparse_pc.ply").write_text(header + rows)

    capture = read_capture(write_scene(PLAIN, tmp_path / "scene", write))
    assert capture.sparse_points is not None
    np.testing.assert_array_equal(capture.sparse_points.positions, PLAIN.points)
    before = np.array([0.3, -0.4, 0.9])
    expected = 0.5 * (np.array(applied)[:, :3] @ before + np.array(applied)[:, 3])
    frame = capture.frames[0]
    np.testing.assert_allclose(frame.linear @ before + frame.shift, expected)


# ---------------------------------------------------------------------- damage


def changed(file: str, old: str, new: str) -> Callable[[Path], None]:
    def damage(folder: Path) -> None:
        text = (folder / file).read_text()
        assert old in text
        (folder / file).write_text(text.replace(old, new, 1))

    return damage


def cut(file: str, share: float = 0.5) -> Callable[[Path], None]:
    def damage(folder: Path) -> None:
        data = (folder / file).read_bytes()
        (folder / file).write_bytes(data[: int(share * len(data))])

    return damage


BOMB = '<!DOCTYPE d [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;&a;&a;">]>\n<document'
DAMAGE: dict[str, tuple[str, Callable[[Path], object], str]] = {
    "opensfm cut": ("OpenSfM", cut("reconstruction.json"), r"reconstruction\.json: line 1: expected JSON"),
    "opensfm panorama": (
        "OpenSfM",
        changed("reconstruction.json", '"brown"', '"equirectangular"'),
        r"\[0\]\.cameras\.c: projection type equirectangular is not supported",
    ),
    "opensfm dual": ("OpenSfM", changed("reconstruction.json", '"brown"', '"dual"'), "projection type dual is not supp"),
    "opensfm camera": ("OpenSfM", changed("reconstruction.json", '"camera": "c"', '"camera": "e"'), "a camera of the file"),
    "opensfm key twice": (
        "OpenSfM",
        changed("reconstruction.json", '"width": 96', '"width": 96, "width": 97'),
        r'reconstruction\.json: expected each key of an object once, found "width" twice',
    ),
    "opensfm photo": ("OpenSfM", lambda f: (f / "images" / "b.png").unlink(), r"photo b\.png: .*--leave-out b\.png"),
    "opensfm track": ("OpenSfM", changed("tracks.csv", "\t0\t0\t", "\t0\t0\tx"), r"tracks\.csv: line 2: expected x, y"),
    "opensfm track short": ("OpenSfM", changed("tracks.csv", "v2\n", "v2\na.png 7\n"), r"line 2: expected image, track"),
    "nvm cut": ("VisualSFM", cut("scene.nvm", 0.1), r"scene\.nvm: (line|expected).*"),
    "nvm cut in points": ("VisualSFM", cut("scene.nvm", 0.8), r"scene\.nvm: (line \d+: )?expected"),
    "nvm rotations": ("VisualSFM", changed("scene.nvm", "NVM_V3", "NVM_V3_R9T"), "expected NVM_V3, found NVM_V3_R9T"),
    "nvm calibration": ("VisualSFM", changed("scene.nvm", "NVM_V3", "NVM_V3 FixedK 110"), "expected FixedK fx cx fy cy r"),
    "nvm corner": (
        "VisualSFM",
        changed("scene.nvm", "NVM_V3", "NVM_V3 FixedK 110 0 110 0"),
        "expected the principal point of FixedK near the middle of the 96x72 photo",
    ),
    "nvm count": ("VisualSFM", changed("scene.nvm", "\n4\n", "\n999999999999\n"), r"scene\.nvm: .*expected FILE FOCAL"),
    "nvm camera": ("VisualSFM", changed("scene.nvm", "30 4 0 0", "30 4 9 0"), "expected a camera below 4, found 9"),
    "nvm NaN": ("VisualSFM", changed("scene.nvm", "30 4 0 0", "30 4 0 nan"), "in finite numbers, found"),
    "metashape cut": ("Metashape", cut("cameras.xml"), r"cameras\.xml: line 2: expected XML"),
    "metashape entities": ("Metashape", changed("cameras.xml", "<document", BOMB), "without DOCTYPE and ENTITY"),
    "metashape spherical": (
        "Metashape",
        changed("cameras.xml", 'calibration type="frame"', 'calibration type="spherical"'),
        "sensor unknown: camera type spherical is not supported",
    ),
    "metashape p3": ("Metashape", changed("cameras.xml", "<cx>", "<p3>0.1</p3><cx>"), "distortion p3 of a frame camera"),
    "metashape label": ("Metashape", changed("cameras.xml", 'label="b"', 'label="z"'), r"photo z: expected an image file"),
    "metashape two files of a label": (
        "Metashape",
        lambda f: (f / "images" / "b.jpg").write_bytes((f / "images" / "b.png").read_bytes()),
        r"photo b: expected one of this name, found b\.jpg, b\.png",
    ),
    "metashape last row": ("Metashape", changed("cameras.xml", "0.0 1.0</transform>", "0.0 2.0</transform>"), "last row of a pose"),
    "metashape short": ("Metashape", changed("cameras.xml", "0.0 1.0</transform>", "0.0</transform>"), "16 finite numbers"),
    "metashape scale": ("Metashape", changed("cameras.xml", "<scale>1.0", "<scale>0.0"), "a rotation and a positive scale"),
    "realityscan short": ("RealityScan", cut("cameras.csv", 0.95), r"cameras\.csv: line 5: expected 16 values"),
    "realityscan word": ("RealityScan", changed("cameras.csv", "\na.png,", "\na.png,x"), "line 2: x: expected a finite number"),
    "realityscan photo": ("RealityScan", changed("cameras.csv", "\nb.png", "\nz.png"), r"^photo z\.png: expected an image"),
}  # fmt: skip


@pytest.mark.parametrize("what", DAMAGE)
def test_damaged_files_of_every_program_are_one_clear_line(tmp_path: Path, what: str):
    program, damage, said = DAMAGE[what]
    folder = write_scene(PLAIN, tmp_path / "scene", PROGRAM_WRITERS[program])
    damage(folder)
    with pytest.raises(InputError, match=said) as error:
        load_scene(folder)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", PROGRAM_WRITERS)
def test_whatever_is_cut_off_is_read_or_refused_in_one_line(tmp_path: Path, name: str):
    folder = write_scene(PLAIN, tmp_path / "scene", PROGRAM_WRITERS[name])
    (file,) = [
        path for path in folder.iterdir() if path.suffix in (".json", ".nvm", ".xml") or path.name == "cameras.csv"
    ]
    data, said = file.read_bytes(), []
    for share in np.linspace(0, 1, 40)[:-1]:
        file.write_bytes(data[: int(share * len(data))])
        try:
            load_scene(folder)
        except InputError as error:
            said.append(str(error))
    assert said
    assert not any("\n" in line for line in said)


def test_photos_alone_name_what_computes_cameras(tmp_path: Path):
    PLAIN.write_photos(tmp_path / "images")
    for path in (tmp_path, tmp_path / "images", tmp_path / "images" / "a.png"):
        with pytest.raises(InputError, match=r"found none; compute them with `eigenfairing cameras .*images --out"):
            read_capture(path)
    (tmp_path / "notes.doc").write_text("cameras")
    with pytest.raises(InputError, match="expected one of: COLMAP"):
        read_capture(tmp_path)
