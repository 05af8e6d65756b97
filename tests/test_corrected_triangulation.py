"""`triangulate`, `points` and scenes without a mesh, of photos whose cameras are wrong: they are corrected first."""

import json
import shlex
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest

from app.cli.main import run
from app.files.scene_source import SceneSource, write_points_of_run
from app.flips.opening import open_flips
from fairing import Session, load_scene, read_mesh, triangulate
from fairing.camera import Camera
from fairing.errors import InputError
from fairing.features import find_points
from fairing.geometry.closest_point import SurfaceTree
from fairing.io import PhotoChoice, load_capture, read_capture
from fairing.io.colmap_text import read_text_model
from fairing.io.convert import write_capture
from fairing.io.feature_points import load_points
from fairing.io.output_folder import prepare_output_folder
from fairing.scene import CamerasChoice, Scene, View
from tests.wrong_cameras import exact_scene, turned

pytestmark = pytest.mark.slow


def capture_of(folder: Path, views: tuple[View, ...]) -> Path:
    prepare_output_folder(folder)
    write_capture(folder, "scene.json", views)
    return folder


@pytest.fixture(scope="module")
def wrong(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return capture_of(tmp_path_factory.mktemp("captures") / "wrong", turned(exact_scene(), 1.0).views)


@pytest.fixture(scope="module")
def exact(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return capture_of(tmp_path_factory.mktemp("captures") / "exact", exact_scene().views)


def off(positions: np.ndarray) -> float:
    """Lower quartile of the distances to the true surface, percent of the diagonal: farther points are of its surroundings."""
    truth = exact_scene().truth
    assert truth is not None
    return 100 * float(np.quantile(SurfaceTree(truth.surface).distance(positions), 0.25)) / truth.surface.diagonal


def assert_same_cameras(one: tuple[View, ...], other: list[Camera] | tuple[Camera, ...]) -> None:
    for view, camera in zip(one, other, strict=True):
        np.testing.assert_allclose(view.camera.image_from_world, camera.image_from_world, rtol=1e-7, atol=1e-6)


def test_triangulate_corrects_the_cameras_and_says_how_a_run_has_them(wrong: Path, tmp_path: Path, capsys, monkeypatch):
    out, given = tmp_path / "start.ply", tmp_path / "given.ply"
    assert run(["triangulate", str(wrong), "--out", str(out)]) == 0
    said = " ".join(capsys.readouterr().err.split())
    assert "cameras corrected by" in said
    assert run(["triangulate", str(wrong), "--out", str(given), "--cameras", "given"]) == 0
    assert "cameras" not in " ".join(capsys.readouterr().err.split()).replace("--cameras", "")
    # Measured: 0.041 and 0.122.
    assert off(read_mesh(out)[0]) < 0.5 * off(read_mesh(given)[0])
    assert json.loads((tmp_path / "start.report.json").read_text())["cameras"]["taken"]
    assert json.loads((tmp_path / "given.report.json").read_text())["cameras"] is None

    # From Python.
    inputs = load_capture(wrong)
    vertices, faces = triangulate("wrong", inputs.views, inputs.sparse_points).mesh()
    np.testing.assert_array_equal(read_mesh(out)[0], vertices)
    np.testing.assert_array_equal(read_mesh(out)[1], faces)

    # Beside the mesh, in the record of flips, and in the run that the last line names.
    images = read_text_model(tmp_path / "start.cameras").images.values()
    translations = {image.name: image.translation for image in images}
    for view in inputs.views:
        np.testing.assert_allclose(translations[view.name], view.camera.camera_from_world[:, 3], atol=1e-9)
    shown: list[Scene] = []
    monkeypatch.setattr("app.flips.opening.FlipApp", lambda server, scene, trace: shown.append(scene))
    nothing: Any = None
    open_flips(nothing, tmp_path / "start.flips", None, PhotoChoice())
    assert_same_cameras(shown[0].views, [view.camera for view in inputs.views])
    assert inputs.sparse_points is not None
    np.testing.assert_array_equal(shown[0].sparse_positions, inputs.sparse_points.positions)
    words = shlex.split(said.split("`")[1])
    assert words == ["eigenfairing", "fair", str(wrong), "--mesh", str(out)]
    session = Session(load_scene(words[2], mesh=words[4]))
    session.choose_inputs()
    assert_same_cameras(inputs.views, [view.camera for view in session.scene.views])

    # An earlier result is replaced, with its cameras; a folder of others is not.
    assert run(["triangulate", str(wrong), "--out", str(out), "--cameras", "given"]) == 0
    assert not (tmp_path / "start.cameras").exists()
    (tmp_path / "mine.cameras").mkdir()
    assert run(["triangulate", str(wrong), "--out", str(tmp_path / "mine.ply")]) == 1
    assert "mine.cameras exists and is not of an earlier triangulation" in " ".join(capsys.readouterr().err.split())


def test_exact_cameras_give_the_triangulation_of_the_given_ones(exact: Path, tmp_path: Path, capsys):
    for choice in ("given", "refine"):
        assert run(["triangulate", str(exact), "--out", str(tmp_path / f"{choice}.ply"), "--cameras", choice]) == 0
        assert run(["points", str(exact), "--out", str(tmp_path / choice), "--cameras", choice]) == 0
    assert " ".join(capsys.readouterr().err.split()).count("cameras as given: held-out points") == 2
    assert (tmp_path / "refine.ply").read_bytes() == (tmp_path / "given.ply").read_bytes()
    assert not (tmp_path / "refine.cameras").exists()
    for file in ("points.ply", "sparse/images.txt", "sparse/cameras.txt"):
        assert (tmp_path / "refine" / file).read_bytes() == (tmp_path / "given" / file).read_bytes()


def test_points_are_of_the_corrected_cameras_and_written_with_them(wrong: Path, tmp_path: Path, capsys):
    assert run(["points", str(wrong), "--out", str(tmp_path / "refined")]) == 0
    said = " ".join(capsys.readouterr().err.split())
    assert "cameras corrected by" in said
    assert f"`eigenfairing fair {tmp_path / 'refined'} --cameras given` uses them as they are" in said
    assert run(["points", str(wrong), "--out", str(tmp_path / "given"), "--cameras", "given"]) == 0
    assert "corrected" not in capsys.readouterr().err
    written, found = read_capture(tmp_path / "refined"), load_points(tmp_path / "refined" / "points.npz")[0]
    # Measured: 0.024 and 0.153.
    assert off(found.positions) < 0.3 * off(load_points(tmp_path / "given" / "points.npz")[0].positions)
    inputs = load_capture(wrong, points="own")
    assert_same_cameras(written.views, [view.camera for view in inputs.views])
    assert inputs.sparse_points is not None
    np.testing.assert_array_equal(found.positions, inputs.sparse_points.positions)
    np.testing.assert_array_equal(found.positions, find_points(inputs.views).positions)


def test_a_scene_without_a_mesh_is_triangulated_with_corrected_cameras(wrong: Path, tmp_path: Path):
    scene, inputs = load_scene(wrong), load_capture(wrong)
    assert scene.refinement is not None
    assert scene.refinement.taken
    assert (scene.cameras_choice, scene.cameras_origin) == ("given", "corrected")
    assert_same_cameras(scene.views, [view.camera for view in inputs.views])
    assert scene.given_cameras is not None
    assert_same_cameras(read_capture(wrong).views, scene.given_cameras)
    np.testing.assert_array_equal(
        scene.mesh.vertices, triangulate("wrong", inputs.views, inputs.sparse_points).result().mesh.vertices
    )
    header = Session(scene).trace.header
    assert header["refinement"]["reason"] == scene.refinement.reason
    assert len(header["cameras"]) == len(scene.views)
    assert load_scene(wrong, cameras="given").cameras_origin == "given"


def test_a_recorded_scene_without_a_mesh_is_the_same_when_it_is_opened_again(wrong: Path, tmp_path: Path):
    source = SceneSource.typed(str(wrong), None, points="automatic", cameras="automatic")
    scene, header = source.load(), {}
    source.resolved(scene.sparse_points, True).note_in(header)
    recorded = SceneSource.of_run(json.loads(json.dumps(header)), tmp_path / "run.trace")
    write_points_of_run(scene.sparse_points, tmp_path / "run.trace")
    with_file = SceneSource.of_run(header, tmp_path / "run.trace")
    assert with_file.points_file is not None
    for again in (recorded.load(), with_file.load()):
        np.testing.assert_array_equal(again.mesh.vertices, scene.mesh.vertices)
        np.testing.assert_array_equal(again.sparse_positions, scene.sparse_positions)
        assert_same_cameras(again.views, [view.camera for view in scene.views])


def test_a_record_names_the_choice_of_cameras_that_its_triangulation_had(tmp_path: Path):
    header: dict = {}
    for choice in get_args(CamerasChoice):
        SceneSource(str(tmp_path), cameras=choice).note_in(header)
        assert SceneSource.of_run(header, tmp_path / "run.trace").cameras == choice
    SceneSource(str(tmp_path), cameras="refine").resolved(None, False).note_in(header)  # skipped on request
    assert SceneSource.of_run(header, tmp_path / "run.trace").cameras == "given"
    header["source"]["cameras"] = "best"
    with pytest.raises(InputError, match="cameras: expected one of automatic, refine, refine_lens, given, found best"):
        SceneSource.of_run(header, tmp_path / "run.trace")
