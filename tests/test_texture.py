"""Textured models: separate faces in the atlas, colours of the photos, and files that other programs read."""

import io
import json
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from app.cli.main import run
from fairing.errors import InputError
from fairing.geometry.rasterize import rasterize
from fairing.io import read_mesh, write_mesh
from fairing.io.textured_mesh import write_textured
from fairing.judge.left_out import psnr
from fairing.mesh import Mesh
from fairing.photo import ArrayPhoto
from fairing.scene import Scene, View
from fairing.texture import AtlasLayout, TexturedModel, textured_model
from tests.small_scene import FACES, VERTICES, corner_scene, photos, write_corner
from tests.texture_view import inner, shown_in


@pytest.mark.parametrize(("largest", "gutter"), [(1024, 2), (300, 4)])
def test_most_faces_is_the_exact_limit(largest, gutter):
    most = AtlasLayout.most_faces(largest, gutter)
    layout = AtlasLayout.plan(np.ones((most, 3)), largest, gutter)
    assert max(layout.width, layout.height) <= largest
    with pytest.raises(ValueError, match="do not fit"):
        AtlasLayout.plan(np.ones((most + 1, 3)), largest, gutter)


@pytest.mark.parametrize("largest", [4096, 500])
def test_no_face_reads_the_texels_of_another(largest):
    rng = np.random.default_rng(3)
    lengths = np.exp(rng.uniform(np.log(5), np.log(150), 60))
    edges = np.column_stack([lengths, lengths * rng.uniform(0.7, 1, 60), lengths * rng.uniform(0.4, 0.9, 60)])
    layout = AtlasLayout.plan(edges, largest)
    assert max(layout.width, layout.height) <= largest
    owner = np.full((layout.height, layout.width), -1)
    y, x = np.mgrid[: layout.height, : layout.width]
    for face, uv in enumerate(layout.uv):
        a, b, c = uv * (layout.width, layout.height) - 0.5
        M = np.linalg.inv(np.column_stack([b - a, c - a]))
        u, v = np.einsum("ij,jhw->ihw", M, np.stack([x - a[0], y - a[1]]))
        # Bilinear look-ups within the face reach a texel beyond it.
        reach = np.abs(M).sum(axis=1)
        near = (u >= -reach[0]) & (v >= -reach[1]) & (u + v <= 1 + reach.sum())
        assert (owner[near] == -1).all(), f"face {face} shares texels with {set(owner[near].tolist())}"
        owner[near] = face


def test_texels_match_photo_pixels_until_the_texture_is_full():
    edges = np.tile([100.0, 80.0, 60.0], (200, 1))
    free, full = AtlasLayout.plan(edges, 10000), AtlasLayout.plan(edges, 600)
    assert free.scale == 1
    assert (free.legs >= (80, 60)).all()
    assert (free.legs < np.array([80, 60]) * 1.2).all()
    assert full.scale < 0.7
    with pytest.raises(ValueError, match="200 faces do not fit"):
        AtlasLayout.plan(edges, 64)


def test_the_true_model_looks_like_the_photos_and_a_wrong_one_does_not():
    scene = corner_scene()
    right, wrong = (textured_model(scene, vertices) for vertices in (VERTICES, scene.mesh.vertices))
    for view in scene.views[:3]:
        photo = view.photo.load().astype(np.float64)
        image, is_shown = shown_in(right, view.camera)
        found = psnr(image[inner(is_shown)], photo[inner(is_shown)])
        assert found > 29, found  # other photos are taken from elsewhere, so their pixels lie elsewhere
        ghosts, is_shown = shown_in(wrong, view.camera)
        worse = psnr(ghosts[inner(is_shown)], photo[inner(is_shown)])
        assert worse < found - 3, (worse, found)


def test_exposures_of_the_photos_leave_no_seams():
    gains = np.array([0.75, 1.25, 0.85, 1.1, 0.95, 1.2, 0.8, 1.05])
    plain = corner_scene()
    exposed = {i: np.clip(photo * gains[i] * 0.8, 0, 255).astype(np.uint8) for i, photo in enumerate(photos())}
    even, uneven = textured_model(plain, VERTICES), textured_model(corner_scene(change=exposed), VERTICES)
    ratio = [
        shown_in(uneven, view.camera)[0][FACE].mean() / shown_in(even, view.camera)[0][FACE].mean()
        for view in plain.views[:1]
        for FACE in [rasterize(VERTICES, FACES, view.camera)[0] == f for f in range(6)]
        if FACE.sum() > 200
    ]
    assert len(ratio) >= 4
    assert max(ratio) / min(ratio) < 1.02, ratio


def test_an_artefact_in_one_photo_is_suppressed():
    painted = photos()[0].copy()
    painted[30:90, 50:110] = 255
    clean, disturbed = (
        textured_model(corner_scene(), VERTICES),
        textured_model(corner_scene(change={0: painted}), VERTICES),
    )
    camera = corner_scene().views[0].camera
    one, is_shown = shown_in(clean, camera)
    other, _ = shown_in(disturbed, camera)
    difference = np.abs(one - other)[30:90, 50:110][is_shown[30:90, 50:110]]
    assert np.percentile(difference, 95) < 6, np.percentile(difference, [50, 95, 99])


def test_a_face_that_no_photo_sees_is_grey():
    scene = corner_scene()
    faces = np.vstack([FACES, [1, 2, 6]])  # behind the others
    hidden = Scene.build("hidden", VERTICES, faces, scene.views)
    model = textured_model(hidden, VERTICES)
    x, y = (model.uv[6].mean(axis=0) * model.image.shape[1::-1]).astype(int)
    assert model.image[y, x].tolist() == [96, 96, 96]


@pytest.fixture(scope="module")
def model() -> TexturedModel:
    return textured_model(corner_scene(), VERTICES)


@pytest.mark.parametrize("suffix", [".obj", ".ply"])
def test_trimesh_reads_the_written_model(tmp_path: Path, model: TexturedModel, suffix: str):
    write_textured(tmp_path / f"model{suffix}", model)
    read = trimesh.load_mesh(tmp_path / f"model{suffix}", process=False)
    np.testing.assert_allclose(read.triangles, model.vertices[model.faces], atol=1e-7)
    uv = np.asarray(read.visual.uv)[read.faces]
    np.testing.assert_allclose(uv * (1, -1) + (0, 1), model.uv, atol=1e-6)
    picture = np.asarray(Image.open(tmp_path / "model.png"))
    np.testing.assert_array_equal(picture, model.image)


def test_a_glb_holds_everything_and_stays_exact_far_from_the_origin(tmp_path: Path, model: TexturedModel):
    far = np.array([4e6, -2e6, 1e5])
    write_textured(tmp_path / "model.glb", TexturedModel(model.vertices + far, model.faces, model.uv, model.image))
    read = trimesh.load_scene(tmp_path / "model.glb", process=False).to_mesh()
    np.testing.assert_allclose(read.triangles - far, model.vertices[model.faces], atol=1e-6)
    content = (tmp_path / "model.glb").read_bytes()
    length = struct.unpack("<I", content[12:16])[0]
    document = json.loads(content[20 : 20 + length])
    assert struct.unpack("<I", content[8:12])[0] == len(content)
    view = document["bufferViews"][document["images"][0]["bufferView"]]
    start = 28 + length + view["byteOffset"]
    picture = np.asarray(Image.open(io.BytesIO(content[start : start + view["byteLength"]])))
    assert picture.shape == model.image.shape
    assert np.abs(picture.astype(int) - model.image).mean() < 2


def test_another_suffix_is_refused_in_one_line(tmp_path: Path, model: TexturedModel):
    with pytest.raises(InputError, match=r"model\.stl: textured models are written as"):
        write_textured(tmp_path / "model.stl", model)
    assert list(tmp_path.iterdir()) == []


def test_masked_pixels_do_not_contribute():
    class Right:
        size = (160, 120)

        def load(self) -> np.ndarray:
            counts = np.ones((120, 160), dtype=bool)
            counts[:, :80] = False
            return counts

    scene = corner_scene()
    views = [View(v.name, v.camera, ArrayPhoto(np.full((120, 160, 3), 250, np.uint8))) for v in scene.views[:1]]
    masked = [View(v.name, v.camera, v.photo, Right()) for v in views]  # pyright: ignore[reportArgumentType]
    white = textured_model(Scene.build("m", VERTICES, FACES, (*masked, *scene.views[1:])), VERTICES)
    image, is_shown = shown_in(white, scene.views[0].camera)
    clean, _ = shown_in(textured_model(scene, VERTICES), scene.views[0].camera)
    left = inner(is_shown).copy()
    left[:, 76:] = False
    assert np.median(np.abs(image - clean)[left]) < 4
    assert np.percentile(np.abs(image - clean)[left], 95) < 15


def test_the_command_writes_a_model_and_refuses_bad_sizes(tmp_path: Path, capsys):
    write_corner(tmp_path / "corner")
    assert run(["texture", str(tmp_path / "corner"), "--out", str(tmp_path / "m.obj")]) == 0
    assert sorted(path.name for path in tmp_path.glob("m.*")) == ["m.mtl", "m.obj", "m.png"]
    capsys.readouterr()
    assert run(["texture", str(tmp_path / "corner"), "--out", str(tmp_path / "m.glb"), "--size", "5"]) == 1
    assert capsys.readouterr().err.splitlines() == ["eigenfairing: --size: expected 64 to 16384 texels, found 5"]
    assert run(["texture", str(tmp_path / "corner"), "--out", str(tmp_path / "none" / "m.glb")]) == 1
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_fair_writes_models_and_the_evaluation_on_left_out_photos(tmp_path: Path, capsys):
    write_corner(tmp_path / "corner")
    out = tmp_path / "out"
    quick = ["--schedule.blur", "2", "1", "--schedule.max-sweeps", "2", "--cells.size", "32"]
    wanted = ["--textured", "--textured-before", "--left-out"]
    assert run(["fair", str(tmp_path / "corner"), "--out", str(out), *quick, *wanted]) == 0
    assert {"model.glb", "model_before.glb", "left_out.png"} <= {path.name for path in out.iterdir()}
    proof = json.loads((out / "report.json").read_text())["left_out"]
    assert proof["photos_judged"] == 8 == len(proof["photos"])
    assert proof["psnr_after"] > proof["psnr_before"] + 1
    assert proof["photos_better"] >= 7
    assert 0.05 < proof["judged_share"] < 0.9
    assert f"{proof['judged_share']:.0%} of their pixels" in capsys.readouterr().err


def test_another_mesh_is_evaluated_on_the_pixels_that_both_show(tmp_path: Path, capsys):
    """The start without one of its six faces: where both show a surface it is the same as the start."""
    write_corner(tmp_path / "corner")
    start = Mesh(*read_mesh(tmp_path / "corner" / "mesh.obj"))
    write_mesh(tmp_path / "part.ply", start.vertices, start.faces[:5])
    command = ["fair", str(tmp_path / "corner"), "--out", str(tmp_path / "out"), "--schedule.blur", "2", "1"]
    command += ["--schedule.max-sweeps", "2", "--cells.size", "32", "--beside", str(tmp_path / "part.ply")]
    assert run(command) == 1
    assert "--left-out" in capsys.readouterr().err
    assert run([*command, "--left-out"]) == 0
    proof = json.loads((tmp_path / "out" / "report.json").read_text())["left_out"]
    assert proof["psnr_beside"] == pytest.approx(
        proof["psnr_before"], abs=0.3
    )  # two sources of a pixel less, here and there
    assert proof["psnr_after"] > proof["psnr_beside"] + 1
    assert proof["photos_better_than_beside"] >= 7
    assert f"PSNR {proof['psnr_beside']:.2f} dB" in capsys.readouterr().err
