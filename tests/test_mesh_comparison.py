"""Meshes of any origin, compared by the same photos, points and reference."""

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

from app.cli.main import run
from app.export.orbit import VIEWS, orbit, orbit_pictures
from app.palette import BACKGROUND
from demo_scenes import load_demo
from fairing import InputError, Mesh, Scene, SparsePoints, compare_meshes
from fairing.judge.left_out import leave_one_out
from fairing.judge.mesh_comparison import MeshFigures


@pytest.fixture(scope="module")
def scene() -> Scene:
    return load_demo("cube")


@pytest.fixture(scope="module")
def truth(scene: Scene) -> Mesh:
    assert scene.truth is not None
    assert scene.truth.vertices is not None
    return scene.mesh.moved(scene.truth.vertices)


def fine(mesh: Mesh) -> Mesh:
    """The same surface in four times as many faces."""
    divided = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).subdivide()
    return Mesh(divided.vertices, divided.faces)


@pytest.fixture(scope="module")
def figures(scene: Scene, truth: Mesh) -> list[MeshFigures]:
    """Of the start, the truth and the truth in other faces, with sparse points beside the true corner A that no mesh has."""
    corners = truth.vertices[truth.faces[:2]]
    weights = np.random.default_rng(1).dirichlet((1, 1, 1), size=(2, 20))
    positions = np.einsum("fpk,fkc->fpc", weights, corners).reshape(-1, 3)
    views = np.repeat(np.arange(len(positions)), 3)
    observations = np.stack([views, np.tile([0, 1, 2], len(positions))], axis=1)
    pixels = np.array([scene.views[v].camera.project(positions[[p]])[0][0] for p, v in observations])
    points = SparsePoints(positions, np.zeros((len(positions), 3), np.uint8), observations, pixels)
    return compare_meshes(
        Scene.build("cube", scene.mesh.vertices, scene.mesh.faces, scene.views, sparse_points=points),
        [scene.mesh, truth, fine(truth)],
        truth,
    )


@pytest.mark.slow
def test_the_better_mesh_is_better_by_every_figure(figures: list[MeshFigures]):
    start, best, divided = figures
    assert best.residual < 0.2 * start.residual
    assert best.left_out.psnr.mean() > start.left_out.psnr.mean() + 5
    for figure in (best, divided):
        assert figure.held_out is not None
        assert figure.held_out.values.max() < 1e-9
    assert start.held_out is not None
    assert len(start.held_out.values) == len(best.held_out.values if best.held_out else [])
    assert start.held_out.values.max() > 1e-3


@pytest.mark.slow
def test_predictions_are_those_of_leave_one_out_and_other_faces_change_little(
    scene: Scene, truth: Mesh, figures: list[MeshFigures]
):
    start, best, divided = figures
    before, after, _ = leave_one_out(scene, scene.mesh.vertices, truth.vertices, fine(truth))
    assert np.array_equal(start.left_out.psnr, before.psnr)
    assert np.array_equal(best.left_out.psnr, after.psnr)
    assert divided.left_out.psnr == pytest.approx(best.left_out.psnr, abs=0.5)
    assert divided.residual == pytest.approx(best.residual, rel=0.3)


def test_distances_to_a_reference_go_both_ways(truth: Mesh, figures: list[MeshFigures]):
    for figure in figures[1:]:
        for found in (figure.to_reference, figure.from_reference):
            assert found is not None
            assert found.values.max() < 1e-9
    part = Mesh(truth.vertices, truth.faces[:1])
    of_part, _ = compare_meshes(figures[0].scene, [part, truth], truth)
    assert of_part.to_reference is not None
    assert of_part.from_reference is not None
    assert of_part.to_reference.values.max() < 1e-9, "a part of the truth lies on it"
    assert np.median(of_part.from_reference.percent) > 10, "but does not cover it"


def test_one_mesh_cannot_be_compared(scene: Scene):
    with pytest.raises(InputError, match="at least two, found 1"):
        compare_meshes(scene, [scene.mesh])


def test_cameras_turn_around_all_meshes_and_show_them_whole(scene: Scene, figures: list[MeshFigures]):
    cameras = orbit([figure.scene for figure in figures], 120)
    assert len(cameras) == VIEWS
    for camera in cameras:
        for figure in figures:
            pixels, depth = camera.project(figure.scene.mesh.vertices)
            assert (depth > 0).all()
            assert (pixels >= -1e-9).all()
            assert (pixels <= 119 + 1e-9).all()
    centers = np.array([camera.center for camera in cameras])
    assert np.ptp(np.linalg.norm(centers - centers.mean(axis=0), axis=1)) < np.ptp(centers)
    textured, shaded = orbit_pictures(scene, cameras[:1], lambda fraction: None)
    inside = (textured[0] != BACKGROUND).any(axis=2)
    assert 0.1 < inside.mean() < 0.9
    assert np.array_equal(inside, (shaded[0] != BACKGROUND).any(axis=2))
    assert (np.ptp(shaded[0].astype(int)[inside], axis=1) <= 10).mean() > 0.9, "grey, but for the smooth outline"


def test_the_command_writes_page_and_figures(
    scene: Scene, truth: Mesh, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    for name, mesh in (("start", scene.mesh), ("truth <b>", truth)):
        trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(tmp_path / f"{name}.ply")
    files = [str(tmp_path / f"{name}.ply") for name in ("start", "truth <b>")]
    out = tmp_path / "meshes.html"
    assert run(["compare", "cube", *files, "--out", str(out), "--reference", files[1]]) == 0
    found = json.loads(out.with_suffix(".json").read_text())["meshes"]
    assert found["truth <b>.ply"]["psnr"] > found["start.ply"]["psnr"]
    assert found["truth <b>.ply"]["to_reference"]["max_percent"] < 1e-6
    page = out.read_text()
    assert "<b>.ply" not in page.replace("&lt;b&gt;.ply", ""), "names are escaped"
    assert "from the reference" in page
    assert "start.ply: residual" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["missing.ply", "b.ply", "--out", "x.html"], "missing.ply"),
        (["a.ply", "--out", "x.txt"], "expected a file ending in .html"),
        (["a.ply", "--out", "nowhere/x.html"], "there is no folder nowhere"),
    ],
)
def test_wrong_words_are_one_line(words: list[str], message: str, capsys: pytest.CaptureFixture[str]):
    assert run(["compare", "cube", *words]) == 1
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
