"""Capture check: convention mistakes in cameras, texture and exposure, and the self-contained page."""

import json
import re
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from app.cli.main import run
from app.files.check_page import check_page
from app.pictures.check_pictures import HELD_BACK, IN_PART, OUT, contact_sheet, overlay
from fairing.camera import Camera
from fairing.cameras.judge import CameraJudgement
from fairing.cameras.refinement import Iteration, Refinement
from fairing.check.appearance import exposures, measure_appearance
from fairing.check.conventions import explain_reprojection, median_shift
from fairing.check.scene_check import check_scene
from fairing.errors import InputError
from fairing.io import load_scene
from fairing.io.in_view import check_mesh_in_view
from fairing.photo import ArrayPhoto, Mask
from fairing.scene import Scene, SparsePoints, View
from tests.foreign_formats import ForeignCapture, write_scene
from tests.small_scene import HEIGHT, WIDTH, corner_scene, photos, write_corner

AXES = np.diag([1.0, -1.0, -1.0])


def with_points(scene: Scene, noise: float = 0.3) -> Scene:
    """The scene with points on its faces, as its photos see them."""
    rng = np.random.default_rng(5)
    corners = scene.mesh.vertices[scene.mesh.faces]
    positions = np.concatenate([rng.dirichlet((1, 1, 1), 20) @ triangle for triangle in corners])
    observations, pixels = [], []
    for v, view in enumerate(scene.views):
        observations.append(np.column_stack([np.arange(len(positions)), np.full(len(positions), v)]))
        pixels.append(view.camera.project(positions)[0] + rng.normal(0, noise, (len(positions), 2)))
    sparse = SparsePoints(
        positions, np.zeros((len(positions), 3), np.uint8), np.concatenate(observations), np.concatenate(pixels)
    )
    return replace(scene, sparse_points=sparse)


def with_cameras(scene: Scene, change: Callable[[Camera], np.ndarray]) -> Scene:
    views = tuple(replace(v, camera=Camera(change(v.camera), v.camera.width, v.camera.height)) for v in scene.views)
    return replace(scene, views=views)


def shifted(dx: float, dy: float) -> Callable[[Camera], np.ndarray]:
    return lambda camera: np.array([[1, 0, dx], [0, 1, dy], [0, 0, 1]]) @ camera.image_from_world


def posed(change: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> Callable[[Camera], np.ndarray]:
    def changed(camera: Camera) -> np.ndarray:
        Rt = camera.camera_from_world
        return camera.K @ change(Rt[:, :3], Rt[:, 3])

    return changed


MISTAKES: dict[str, tuple[Callable[[Camera], np.ndarray], str | None]] = {
    "none": (lambda camera: camera.image_from_world, None),
    "a tenth": (shifted(0.1, -0.1), None),
    "half a pixel": (shifted(0.5, 0.5), r"half a pixel.*centre of the top-left pixel at \(0\.5, 0\.5\)"),
    "half a pixel back": (shifted(-0.5, -0.5), r"half a pixel.*top-left pixel at \(0, 0\) instead of \(0\.5, 0\.5\)"),
    "principal point": (shifted(0.3, 1.2), r"\(\+0\.\d+, \+1\.\d+\) px .*principal point is wrong"),
    "opengl": (posed(lambda R, t: AXES @ np.column_stack([R, t])), r"if axes are y up, z backwards"),
    "inverse": (posed(lambda R, t: np.column_stack([R.T, -R.T @ t])), r"if poses are camera to world"),
    "left and right": (lambda c: np.array([[-1, 0, WIDTH - 1], [0, 1, 0], [0, 0, 1]]) @ c.image_from_world, "mirrored"),
    "turned": (lambda c: np.array([[-1, 0, WIDTH - 1], [0, -1, HEIGHT - 1], [0, 0, 1]]) @ c.image_from_world, "180"),
    "twice the size": (lambda c: np.diag([2.0, 2.0, 1.0]) @ c.image_from_world, "if cameras are for photos of twice"),
}  # fmt: skip


@pytest.mark.parametrize("what", MISTAKES)
def test_a_mistake_in_the_cameras_is_recognised_by_the_sparse_points(what: str):
    change, said = MISTAKES[what]
    found = explain_reprojection(with_cameras(with_points(corner_scene()), change))
    if said is None:
        assert found is None
    else:
        assert found is not None
        assert re.search(said, found), found


def test_one_bad_photo_is_not_attributed_to_all_cameras():
    scene = with_points(corner_scene())
    views = list(scene.views)
    views[0] = replace(views[0], camera=Camera(shifted(3, 0)(views[0].camera), WIDTH, HEIGHT))
    scene = replace(scene, views=tuple(views))
    assert explain_reprojection(scene) is None
    check = check_scene(scene)
    assert check.verdict == "doubtful"
    assert any("photo photo0: the reprojection error of the sparse points is 3" in hint for hint in check.hints)
    shift = median_shift(scene, 0)
    assert shift is not None
    assert shift == pytest.approx((3, 0), abs=0.15)


def test_a_mesh_that_no_photo_shows_is_explained_by_the_poses():
    change, said = MISTAKES["inverse"]
    assert said is not None
    with pytest.raises(InputError, match=rf"none of its 7 vertices lies inside any.*they would {said}"):
        check_mesh_in_view(with_cameras(corner_scene(), change))


def flat_scene(pictures: list[np.ndarray]) -> Scene:
    """Two triangles, each as wide as a photo, seen frontally by cameras side by side."""
    h, w = pictures[0].shape
    vertices = np.array([[0, 0, 0], [w - 1, 0, 0], [w - 1, h - 1, 0], [0, h - 1, 0]], float)
    views = []
    for i, picture in enumerate(pictures):
        P = np.array([[100.0, 0, 0, 0], [0, 100, 0, 0], [0, 0, 1, 100]])
        views.append(
            View(f"{i}", Camera(P, w, h), ArrayPhoto(np.repeat(picture[..., None], 3, axis=2).astype(np.uint8)))
        )
    return Scene.build("flat", vertices, np.array([[0, 2, 1], [0, 3, 2]]), tuple(views))


def test_texture_is_the_gradient_in_grey_levels_a_pixel():
    x, y = np.meshgrid(np.arange(60), np.arange(50))
    ramp = flat_scene([3 * x + 0 * y + 20] * 3)
    found = measure_appearance(ramp, np.zeros((2, 3), np.int8))
    np.testing.assert_allclose(found.texture, 3, rtol=0.05)
    np.testing.assert_allclose(found.weakest, 0, atol=0.2)
    np.testing.assert_allclose(found.mean.mean(axis=0), (3 * 29.5 + 20), rtol=0.05)
    blank = measure_appearance(flat_scene([np.full((50, 60), 77)] * 3), np.zeros((2, 3), np.int8))
    np.testing.assert_array_equal(blank.texture, 0)


def test_exposures_are_estimated_from_shared_faces():
    gains = np.array([1.0, 0.8, 1.2, 1.0, 0.6, 1.0, 1.0, 1.0])
    change = {v: np.round(photos()[v] * gain).astype(np.uint8) for v, gain in enumerate(gains)}
    scene = corner_scene(displacement=(0, 0, 0), change=change)
    found = exposures(measure_appearance(scene, check_scene(scene).visibility).mean)
    np.testing.assert_allclose(found, gains, rtol=0.03)


def test_every_face_has_its_views_size_texture_and_reason():
    scene = corner_scene()
    vertices, faces = scene.mesh.vertices, scene.mesh.faces
    turned = np.vstack([faces, [[1, 6, 2]]])  # a lid inside, seen from behind
    check = check_scene(replace(scene, mesh=type(scene.mesh)(vertices, turned), original_faces=turned))
    assert check.n_faces == 7
    assert check.faces.takes_part.tolist()[:6] == [True] * 6
    assert check.faces.reason[:6] == [""] * 6
    assert not check.faces.takes_part[6]
    assert check.faces.reason[6] in ("turned_away", "hidden", "grazing")
    assert (check.faces.n_views[:6] >= 5).all()
    corners = np.array([view.camera.project(vertices[faces])[0] for view in scene.views])
    u, v = corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0]
    areas = np.abs(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]) / 2
    assert check.faces.footprint[:6] == pytest.approx(np.sqrt(areas.mean(axis=0)), rel=0.15)
    json.dumps(check.as_dict()["hints"])


def test_suggestions_name_the_first_level_and_an_open_mesh():
    scene = corner_scene()
    found = " ".join(check_scene(scene).suggestions)
    assert "a run starts at about level" in found


def test_the_overlay_shows_what_takes_part_and_what_is_masked(tmp_path: Path):
    scene = corner_scene()
    counts = np.ones((HEIGHT, WIDTH), np.uint8) * 255
    counts[:20] = 0
    Image.fromarray(counts).save(tmp_path / "m.png")
    views = (replace(scene.views[0], mask=Mask(tmp_path / "m.png")), *scene.views[1:])
    scene = replace(scene, views=views)
    check = check_scene(scene)
    assert check.views[0].masked == pytest.approx(20 / HEIGHT)
    picture = overlay(scene, check, 0).astype(int)
    for face in np.flatnonzero(check.faces.takes_part):
        uv, _ = scene.views[1].camera.project(scene.mesh.vertices[scene.mesh.faces[face]])
        a, b, _ = np.round(uv).astype(int)
        middle = (a + b) // 2
        near = overlay(scene, check, 1)[middle[1] - 1 : middle[1] + 2, middle[0] - 1 : middle[0] + 2].astype(int)
        assert np.abs(near - np.array(IN_PART.color)).sum(-1).min() < 120
    assert picture[2:15].mean() < 0.4 * overlay(scene, check, 1)[2:15].mean()
    assert overlay(scene, check, 0, width=80).shape == (60, 80, 3)
    assert len({line.color for line in (IN_PART, HELD_BACK, OUT)}) == 3


def test_the_contact_sheet_holds_every_picture():
    pictures = [np.full((40, 60, 3), 10 * i, np.uint8) for i in range(1, 6)]
    sheet = np.asarray(contact_sheet(pictures, ["a name that is much too long for its picture"] * 5))
    for i in range(1, 6):
        assert ((sheet == 10 * i).all(axis=-1)).sum() >= 40 * 60


class Page(HTMLParser):
    """Collects the tags, and checks that they close in order."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self._open: list[str] = []
        self.feed(text)
        assert not self._open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in ("meta", "img", "!doctype"):
            self._open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag


def test_the_page_is_self_contained_and_escapes_input():
    evil = "<script>alert(1)</script>"
    scene = with_points(corner_scene())
    views = (replace(scene.views[0], name=evil), *scene.views[1:])
    scene = replace(scene, name=evil, views=views, warnings=(evil,))
    check = check_scene(scene)
    thumbnails = [overlay(scene, check, v, 64) for v in range(8)]
    page = check_page(scene, check, thumbnails, [f"{v}.png" for v in range(8)])
    assert evil not in page
    tags = Page(page).tags
    assert not [tag for tag, _ in tags if tag in ("script", "link", "iframe")]
    sources = [attributes["src"] or "" for tag, attributes in tags if tag == "img"]
    assert len(sources) == 8
    assert all(source.startswith("data:image/jpeg;base64,") for source in sources)
    assert "http" not in page.replace("http-equiv", "")


def test_check_writes_page_sheet_data_and_overlays(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    write_corner(tmp_path / "corner")
    out = tmp_path / "out"
    assert run(["check", str(tmp_path / "corner"), "--out", str(out)]) == 0
    assert {"check.html", "check.json", "contact-sheet.png"} <= {path.name for path in out.iterdir()}
    found = json.loads((out / "check.json").read_text())
    assert found["views"][0]["exposure"] == pytest.approx(1, abs=0.1)
    assert len(found["faces"]["n_views"]) == 6
    assert "suggestion: faces measure" in capsys.readouterr().out


def test_files_with_a_shift_of_half_a_pixel_are_doubtful(tmp_path: Path):
    capture = ForeignCapture()
    source = write_scene(capture, tmp_path / "scene", "COLMAP")
    cameras = source / "sparse" / "cameras.txt"
    cameras.write_text(cameras.read_text().replace("48.0 36.0", "48.5 36.5"))
    check = check_scene(load_scene(source))
    assert check.verdict != "good"
    assert check.hints[0].startswith("in all photos sparse points are shifted by (+0.50, +0.50) px")


def refined(scene: Scene, taken: bool, corrections: list[float], left: float) -> Scene:
    """The scene after a refinement with these corrections, px, after which the second photo has the median error `left`, px."""
    before, after = np.full(len(scene.views), 0.5), np.full(len(scene.views), 0.1)
    before[1] = max(before[1], left)
    after[1] = left
    judgement = CameraJudgement(100, 0.9, 0.12, 1.0, 0.2, 20.0, 0.1)
    states = tuple(
        Iteration(np.zeros((len(errors), 3)), np.zeros((len(errors), 3)), errors) for errors in (before, after)
    )
    cameras = tuple(view.camera for view in scene.views)
    names = tuple(view.name for view in scene.views)
    found = Refinement(names, taken, "cameras corrected", cameras, np.array(corrections), judgement, None, states)
    return replace(scene, refinement=found)


def test_photos_that_look_distorted_are_a_problem():
    good = refined(with_points(corner_scene()), True, [1.0] * len(corner_scene().views), 0.1)
    assert good.refinement is not None
    note = "photos look distorted; try --cameras refine_lens"
    scene = replace(good, refinement=replace(good.refinement, lens_note=note), warnings=(*good.warnings, note))
    check = check_scene(scene)
    assert check.verdict == "doubtful"
    assert check.hints == (note,), "poses that look wrong through a distorted photo are named as well"
    assert check.warnings == good.warnings
    page = check_page(scene, check, [np.zeros((2, 2, 3), np.uint8)] * len(scene.views), [""] * len(scene.views))
    assert page.count(note) == 1
    assert check.as_dict()["cameras"]["lens_note"] == note


def test_wrong_cameras_are_not_good_and_photos_that_do_not_fit_are_named():
    scene = with_points(corner_scene())
    n, second = len(scene.views), scene.views[1].name
    assert check_scene(scene).cameras is None
    for px, verdict in ((0.3, "good"), (1.0, "doubtful"), (2.0, "doubtful")):
        check = check_scene(refined(scene, True, [px] * n, 0.1))
        assert check.verdict == verdict, check.hints
        assert any(f"off by {px:.1f} px (median" in hint for hint in check.hints) == (verdict == "doubtful")
        assert check.views[0].correction == px
    kept = check_scene(refined(scene, False, [0.1] * n, 0.1))
    assert kept.verdict == "good"
    assert kept.views[0].correction is None
    one = check_scene(refined(scene, True, [0.1, 9.0] + [0.1] * (n - 2), 0.1))
    assert [hint for hint in one.hints if "off by 9.0 px" in hint and second in hint]
    unlike = check_scene(refined(scene, False, [0.1, 9.0] + [0.1] * (n - 2), 0.1))
    assert [hint for hint in unlike.hints if "does not fit" in hint and second in hint]
    for taken in (True, False):
        lost = check_scene(refined(scene, taken, [0.1] * n, 6.0))
        assert [hint for hint in lost.hints if "no correction was found" in hint and second in hint]
        assert json.loads(json.dumps(lost.as_dict()))["cameras"]["misfits"] == [second]
