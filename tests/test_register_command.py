"""Range data on the command line: from a scan in its own frame to a start mesh, and one line for every mistake."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.cli.main import run
from fairing.errors import InputError
from fairing.geometry.closest_point import SurfaceTree
from fairing.io import read_mesh, write_mesh
from fairing.io.scan_file import read_matches, read_scan
from fairing.mesh import Mesh
from fairing.registration.alignment import Similarity
from tests.small_scene import FACES, VERTICES, corner_scene, write_corner

TRUE = Similarity(0.4, Rotation.from_euler("xyz", [40, -70, 130], degrees=True).as_matrix(), np.array([3.0, -1, 0.5]))


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    write_corner(tmp_path / "corner")
    u, v = (w.ravel() for w in np.meshgrid(*2 * [np.linspace(0.013, 0.987, 45)]))
    points = np.concatenate([np.insert(np.column_stack([u, v]), axis, 1.0, axis=1) for axis in range(3)])
    np.savetxt(tmp_path / "scan.xyz", TRUE.undo(points))
    camera = corner_scene().views[2].camera
    lines = [
        f"{a} {b} {c}  {x} {y} {z}" for (a, b, c), (x, y, z) in zip(TRUE.undo(VERTICES[:3]), VERTICES[:3], strict=True)
    ]
    (a, b, c), (x, y) = TRUE.undo(VERTICES[4:5])[0], camera.project(VERTICES[4])[0]
    lines += ["# seen in a photo", f"{a} {b} {c} photo2.png {x} {y}"]
    (tmp_path / "matches.txt").write_text("\n".join(lines) + "\n")
    return tmp_path


def register(capture: Path, *flags: str, out: str = "start.ply") -> int:
    files = [
        "--scan",
        str(capture / "scan.xyz"),
        "--matches",
        str(capture / "matches.txt"),
        "--out",
        str(capture / out),
    ]
    return run(["register", str(capture / "corner"), *files, *flags])


def test_a_scan_becomes_a_start_mesh_on_the_surface(capture: Path):
    assert register(capture, "--spacing", "6") == 0
    vertices, faces = read_mesh(capture / "start.ply")
    surface = SurfaceTree(Mesh(VERTICES, FACES))
    assert len(vertices) > 50
    assert surface.distance(vertices).max() < 1e-6
    assert np.median(surface.distance(vertices[faces].mean(axis=1))) < 0.01
    moved = read_scan(capture / "start.scan.ply")
    assert isinstance(moved, np.ndarray)
    assert surface.distance(moved).max() < 1e-6


def test_a_surface_is_a_scan_too(tmp_path: Path):
    write_mesh(tmp_path / "scan.ply", VERTICES, FACES)
    scan = read_scan(tmp_path / "scan.ply")
    assert isinstance(scan, Mesh)
    np.testing.assert_array_equal(scan.vertices[scan.faces], VERTICES[FACES])


@pytest.mark.parametrize(
    ("line", "found"),
    [
        ("1 2", "2 words"),
        ("1 2 3 4 5", "5 words"),
        ("1 2 3 nowhere.png 4 5", "nowhere.png 4 5"),
        ("1 2 3 photo0.png 4 x", "4 x"),
        ("1 2 nan 4 5 6", "1 2 nan"),
        ("1 2 3 photo0.png 4 5 other.png 1 2", "a photo 'other.png'"),
    ],
)
def test_a_wrong_match_is_named_by_its_line(tmp_path: Path, line: str, found: str):
    (tmp_path / "matches.txt").write_text(f"# matches\n\n{line}\n")
    views = tuple(corner_scene().views)
    named = [type(view)(f"photo{v}.png", view.camera, view.photo) for v, view in enumerate(views)]
    with pytest.raises(InputError, match="line 3: expected") as error:
        read_matches(tmp_path / "matches.txt", named)
    assert found in str(error.value)


def test_mistakes_are_one_line_and_nothing_is_written(capture: Path, capsys):
    (capture / "matches.txt").write_text("0 0 0 0 0 0\n1 0 0 1 0 0\n")
    before = sorted(path.name for path in capture.iterdir())
    assert register(capture) == 1
    assert register(capture, "--spacing", "50") == 1
    assert register(capture, out="start.stl") == 1
    (capture / "scan.xyz").write_text("not numbers")
    assert register(capture) == 1
    assert len(capsys.readouterr().err.splitlines()) == 4
    assert sorted(path.name for path in capture.iterdir()) == before
