"""Refinement of cameras on photos, in a run of its own, and its record in trace, report and folder."""

import io
import json
from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
from rich.console import Console
from scipy.spatial.transform import Rotation

from app.cli.fair import fair_to_folder
from app.cli.run_extras import RunExtras
from app.files.scene_source import SceneSource
from fairing.camera import Camera
from fairing.cameras import Refinement, refine, refinement
from fairing.cameras.corrected_scene import triangulated_again, with_cameras
from fairing.cameras.refinement import Iteration
from fairing.errors import Cancelled, InputError
from fairing.features import find_points
from fairing.io import feature_points, refined_once
from fairing.io.colmap_text import read_text_model
from fairing.io.colmap_write import write_text_model
from fairing.io.convert import write_capture
from fairing.io.load import load_capture, load_scene
from fairing.io.output_folder import prepare_output_folder
from fairing.lens import Lens
from fairing.options import PRESETS, FairingOptions
from fairing.photo import ArrayPhoto
from fairing.run.recorded_refinement import RecordedRefinement
from fairing.run.session import Session
from fairing.run.trace_header import header_of, inputs_of, scene_of_trace, with_recorded_cameras
from fairing.scene import Scene, SparsePoints
from fairing.trace import Trace
from tests.wrong_cameras import bent, exact_scene, turned

BENT = (-0.15, 0.0)
"""Radial distortion of a lens: 15 px at the corners, 2.6 px at the edges of the building."""
PARTS = ("keypoints of 9 photos", "matching photos", "adjustment", "trial of a distortion")


@cache
def refined(px: float) -> Refinement:
    return refine(scene_at(px).views, finds_points=True)


def scene_at(px: float) -> Scene:
    return turned(exact_scene(), px) if px else exact_scene()


def corrected(px: float) -> Scene:
    return replace(with_cameras(scene_at(px), refined(px).cameras), refinement=refined(px))


def rotation_error(cameras: tuple[Camera, ...]) -> float:
    """Root mean square, px at the focal length."""
    pairs = [
        (a.camera_from_world, view.camera.camera_from_world)
        for a, view in zip(cameras, exact_scene().views, strict=True)
    ]
    turns = Rotation.from_matrix(np.array([a[:, :3] @ b[:, :3].T for a, b in pairs])).as_rotvec()
    return float(cameras[0].K[0, 0] * np.sqrt((turns**2).sum(axis=1).mean()))


def test_exact_cameras_are_given_back_unchanged():
    found = refined(0.0)
    assert not found.taken, found.reason
    views = exact_scene().views
    assert found.corrected_views(views) == views
    assert found.reason.startswith("cameras as given")


@pytest.mark.parametrize("px", [0.5, pytest.param(1.5, marks=pytest.mark.slow)])
def test_turned_cameras_are_corrected(px):
    found, wrong = refined(px), turned(exact_scene(), px)
    assert found.taken, found.reason
    before, after = (rotation_error(tuple(v.camera for v in s.views)) for s in (wrong, corrected(px)))
    assert after < 0.5 * before, (before, after)
    assert found.judgement is not None
    assert found.judgement.error_after < 0.6 * found.judgement.error_before
    assert found.found is not None
    searched = find_points(found.corrected_views(wrong.views))  # what a run would find with these cameras
    np.testing.assert_array_equal(found.found.positions, searched.positions)
    assert (found.corrections > 0).all()


def test_refinement_is_deterministic():
    wrong = turned(exact_scene(), 0.5)
    one, other = refined(0.5), refine(wrong.views, threads=1)
    for a, b in zip(one.cameras, other.cameras, strict=True):
        np.testing.assert_array_equal(a.image_from_world, b.image_from_world)


def test_refinement_shows_its_progress_and_keeps_every_iteration_that_it_describes(monkeypatch):
    lines: list[tuple[float, str]] = []
    described: list[Iteration] = []

    def describe(*facts: np.ndarray) -> Iteration:
        described.append(Iteration(*facts))
        return described[-1]

    monkeypatch.setattr(refinement, "Iteration", describe)
    found = refine(scene_at(0.5).views, 1, lambda fraction, line: lines.append((fraction, line)))
    assert list(found.iterations) == described
    fractions = [fraction for fraction, _ in lines]
    assert fractions == sorted(fractions)
    assert 0 <= fractions[0] < fractions[-1] <= 1 + 1e-9
    assert {line.split(",")[0] for _, line in lines} == {f"refining cameras: {part}" for part in PARTS}


@pytest.mark.parametrize("part", PARTS)
def test_refinement_can_be_cancelled_in_each_of_its_parts(part):
    reached: list[str] = []
    with pytest.raises(Cancelled):
        refine(
            scene_at(0.5).views, 1,
            lambda _, line: reached.append(line), lambda: any(part in line for line in reached),
        )  # fmt: skip
    assert sum(part in line for line in reached) <= 3


def test_iterations_of_the_adjustment_are_kept():
    found = refined(0.5)
    assert (found.iterations[0].turns == 0).all()
    assert (found.iterations[0].shifts == 0).all()
    assert len(found.iterations) > 4
    first, last = (np.median(found.iterations[i].errors) for i in (0, -1))
    assert last < 0.5 * first
    scene = corrected(0.5)
    header = json.loads(json.dumps(inputs_of(scene)))
    recorded = RecordedRefinement.of(scene, header)
    assert recorded is not None
    assert len(recorded) == len(found.iterations)
    for step, cameras in ((0, scene.given_cameras), (-1, found.cameras)):
        for a, b in zip(recorded.cameras_at(step), cameras or (), strict=True):
            np.testing.assert_allclose(a.image_from_world, b.image_from_world, rtol=1e-5, atol=1e-4)
    far = recorded.cameras_at(0, 10.0)
    moved = [np.linalg.norm(a.center - b.center) for a, b in zip(far, found.cameras, strict=True)]
    given = [np.linalg.norm(a.center - b.center) for a, b in zip(recorded.given, found.cameras, strict=True)]
    np.testing.assert_allclose(moved, 10 * np.array(given), rtol=1e-3, atol=1e-6)
    assert RecordedRefinement.of(exact_scene(), header) is None
    for damage in (
        {},
        {"refinement": 3},
        {"refinement": {}},
        {"refinement": header["refinement"] | {"iterations": [{}]}},
        {
            "refinement": header["refinement"]
            | {"iterations": [dict(header["refinement"]["iterations"][0], errors=[1e999] * 9)]}
        },
    ):
        assert RecordedRefinement.of(scene, damage) is None


def test_photos_without_points_keep_their_cameras():
    scene = exact_scene()
    grey = replace(
        scene, views=tuple(replace(v, photo=ArrayPhoto(np.full((300, 400, 3), 90, np.uint8))) for v in scene.views)
    )
    found = refine(grey.views)
    assert not found.taken
    assert "too few" in found.reason
    assert found.corrected_views(grey.views) == grey.views


def test_given_points_follow_corrected_cameras():
    scene, cameras = exact_scene(), [view.camera for view in exact_scene().views]
    positions = scene.mesh.vertices[:5]
    observations = np.array([(p, v) for v in range(3) for p in range(4)])
    pixels = np.array([cameras[v].project(positions[p])[0] for p, v in observations])
    off = SparsePoints(positions + 0.01, np.zeros((5, 3), np.uint8), observations, pixels)
    moved = triangulated_again(off, cameras)
    np.testing.assert_allclose(moved.positions[:4], positions[:4], atol=1e-6)
    np.testing.assert_array_equal(moved.positions[4], off.positions[4])  # observed by no photo


def test_a_trace_gives_its_corrected_cameras_back_to_the_bit():
    scene = replace(corrected(0.5), points_choice="given")
    header = json.loads(json.dumps(header_of(scene, Session(scene).options)))
    wrong = replace(turned(exact_scene(), 0.5), points_choice="given")
    again = scene_of_trace(wrong, Trace(header, scene.mesh.vertices, scene.mesh.faces))
    for a, b in zip(scene.views, again.views, strict=True):
        np.testing.assert_array_equal(a.camera.image_from_world, b.camera.image_from_world)
    assert again.cameras_origin == "corrected"
    header["cameras"][0]["matrix"] = "none"
    with pytest.raises(InputError, match="expected a camera for each photo"):
        scene_of_trace(wrong, Trace(header, scene.mesh.vertices, scene.mesh.faces))


def test_a_trace_with_corrected_cameras_accepts_the_given_points_of_its_scene():
    exact, wrong = exact_scene(), turned(exact_scene(), 0.5)
    observations = np.array([(p, v) for p in range(4) for v in range(3)])
    pixels = np.array([exact.views[v].camera.project(exact.mesh.vertices[p])[0] for p, v in observations])
    given = SparsePoints(exact.mesh.vertices[:4] + 0.01, np.zeros((4, 3), np.uint8), observations, pixels)
    wrong = replace(wrong, sparse_points=given, points_choice="given")
    moved = with_cameras(wrong, refined(0.5).cameras)
    assert moved.sparse_points is not None
    assert (moved.sparse_points.positions != given.positions).any()
    trace = Session(moved).trace
    trace.header = json.loads(json.dumps(trace.header))
    again = Session(wrong, trace=trace).scene
    np.testing.assert_array_equal(again.sparse_positions, moved.sparse_positions)


def test_a_run_refines_the_cameras_of_its_scene_and_keeps_the_result(tmp_path, monkeypatch):
    monkeypatch.setenv("EIGENFAIRING_CACHE", str(tmp_path))
    wrong = replace(turned(exact_scene(), 0.5), cameras_choice="refine")
    session = Session(wrong)
    session.choose_inputs()
    for view, camera in zip(session.scene.views, refined(0.5).cameras, strict=True):
        np.testing.assert_array_equal(view.camera.image_from_world, camera.image_from_world)
    assert session.scene.given_cameras == tuple(view.camera for view in wrong.views)
    assert session.scene.sparse_points is not None
    assert session.scene.sparse_points.origin == "own"
    monkeypatch.setattr(refined_once, "refine", lambda *_: pytest.fail("the cache has it"))
    monkeypatch.setattr(feature_points, "find_points", lambda *_: pytest.fail("the cache has them"))
    again = Session(wrong)
    again.choose_inputs()
    assert json.dumps(again.trace.header) == json.dumps(session.trace.header)
    resumed = Session(wrong, trace=session.trace)
    assert resumed.scene.cameras_choice == "given"
    for one, other in zip(resumed.scene.views, session.scene.views, strict=True):
        np.testing.assert_array_equal(one.camera.image_from_world, other.camera.image_from_world)


def test_a_run_whose_given_cameras_were_kept_is_the_run_without_refinement(tmp_path, monkeypatch):
    monkeypatch.setenv("EIGENFAIRING_CACHE", str(tmp_path))
    sessions = [Session(replace(exact_scene(), cameras_choice=choice)) for choice in ("given", "refine")]
    for session in sessions:
        session.choose_inputs()
    given, kept = (session.scene for session in sessions)
    assert kept.given_cameras is None
    assert kept.views == given.views
    np.testing.assert_array_equal(kept.sparse_positions, given.sparse_positions)
    header = sessions[1].trace.header
    assert not header.pop("refinement")["taken"]
    assert header == sessions[0].trace.header


def test_refinement_in_a_run_can_be_skipped_and_cancelled():
    session = Session(replace(turned(exact_scene(), 0.7), cameras_choice="refine", sparse_points=None))
    session.cancel_requested = lambda: True
    with pytest.raises(Cancelled):
        session.choose_inputs()
    assert session.scene.cameras_choice == "refine"
    session.cancel_requested = lambda: False
    session.choose_inputs(skip_requested=lambda: True)
    assert session.scene.given_cameras is None
    assert "cameras were not refined, on request" in session.warnings


def test_given_cameras_are_not_recorded():
    assert "cameras" not in header_of(exact_scene(), Session(exact_scene()).options)


def test_recorded_cameras_are_scaled_with_the_photos():
    scene = with_cameras(exact_scene(), [view.camera for view in exact_scene().views])
    header = header_of(scene, Session(scene).options)
    small = replace(exact_scene(), views=tuple(view.resized(200, 150) for view in exact_scene().views))
    again = scene_of_trace(small, Trace(header, scene.mesh.vertices, scene.mesh.faces))
    for a, b in zip(small.views, again.views, strict=True):
        np.testing.assert_allclose(a.camera.image_from_world, b.camera.image_from_world, rtol=1e-9, atol=1e-9)


@pytest.mark.slow
def test_the_command_writes_corrected_cameras_and_resumes_with_them(tmp_path):
    wrong, capture, out = turned(exact_scene(), 1.0), tmp_path / "capture", tmp_path / "out"
    prepare_output_folder(capture)
    write_capture(capture, "scene.json", wrong.views, None, (wrong.mesh.vertices, wrong.mesh.faces))
    source = SceneSource.typed(str(capture), None, points="own", cameras="automatic")
    options = PRESETS["accurate"].with_levels(max_sweeps=1)
    console = Console(file=(said := io.StringIO()), width=400)
    arguments = (source, out, "accurate", options)
    assert fair_to_folder(*arguments, False, RunExtras(), console) == 0
    assert "cameras corrected by" in said.getvalue()
    report = json.loads((out / "report.json").read_text())
    assert report["cameras"]["taken"]
    assert "iterations" not in report["cameras"]
    python = load_scene(capture, points="own")
    session = Session(python, options)
    session.choose_inputs()
    recorded = Trace.load(out / "run.trace").header
    assert json.loads(json.dumps(session.trace.header["cameras"])) == recorded["cameras"]
    assert json.loads(json.dumps(session.trace.header["refinement"])) == recorded["refinement"]
    assert [photo["name"] for photo in report["cameras"]["photos"]] == [view.name for view in wrong.views]
    trace = Trace.load(out / "run.trace")
    images = {image.name: image for image in read_text_model(out / "cameras").images.values()}
    for name, recorded in zip(trace.header["views"], trace.header["cameras"], strict=True):
        camera = Camera.recorded(np.array(recorded["matrix"]), recorded["width"], recorded["height"])
        np.testing.assert_allclose(images[name].translation, camera.camera_from_world[:, 3], atol=1e-9)
        R = Rotation.from_quat(images[name].quaternion[[1, 2, 3, 0]]).as_matrix()
        np.testing.assert_allclose(R, camera.camera_from_world[:, :3], atol=1e-9)
    mesh = (out / "mesh.ply").read_bytes()
    trace.cut(len(trace) // 2).attach(out / "run.trace")
    assert fair_to_folder(*arguments, True, RunExtras(), console) == 0
    assert (out / "mesh.ply").read_bytes() == mesh
    assert json.loads((out / "report.json").read_text())["cameras"] == report["cameras"]


@cache
def refined_of_bent() -> Refinement:
    return refine(bent(exact_scene(), *BENT).views, adjusts_lens=True)


def bend(lens: Lens) -> float:
    """Where a lens shows a ray near the edge of what the photos show, less where a pinhole with its pixels there would, px."""
    radius, (k1, k2) = 0.35, lens.distortion[:2]
    return float(lens.K[0, 0] * radius**3 * (k1 + k2 * radius**2))


@pytest.mark.slow
def test_the_distortion_of_photos_without_one_is_found_and_removed():
    scene, found = bent(exact_scene(), *BENT), refined_of_bent()
    assert found.taken
    assert found.judgement is not None
    assert found.judgement.error_after < 0.6 * found.judgement.error_before
    width, height = exact_scene().views[0].camera.width, exact_scene().views[0].camera.height
    true = Lens(exact_scene().views[0].camera.K, np.array(BENT), width, height)
    off = [abs(bend(lens) - bend(true)) for lens in found.lenses if lens is not None]
    assert len(off) == len(scene.views)
    assert max(off) < 0.2 * abs(bend(true)), (off, bend(true))
    for view, before, exact in zip(found.corrected_views(scene.views), scene.views, exact_scene().views, strict=True):
        inner = np.s_[40:-40, 40:-40]
        wrong, left = (
            np.abs(v.photo.load()[inner].astype(float) - exact.photo.load()[inner]).mean() for v in (before, view)
        )
        assert left < 0.75 * wrong, "the undistorted photo is not nearer to the one without distortion"


@pytest.mark.slow
def test_poses_corrected_through_a_bent_lens_come_with_a_suggestion(tmp_path, monkeypatch):
    monkeypatch.setenv("EIGENFAIRING_CACHE", str(tmp_path))
    for scene, is_bent in ((bent(exact_scene(), *BENT), True), (turned(exact_scene(), 1.0), False)):
        for _ in ("found", "kept in the cache"):
            session = Session(replace(scene, cameras_choice="refine"))
            session.choose_inputs()
            notes = [line for line in session.warnings if "--cameras refine_lens" in line]
            assert len(notes) == is_bent, session.warnings
    assert not refined_of_bent().lens_note, "the lens is corrected already"
    assert not refined(0.0).lens_note


@pytest.mark.slow
def test_found_lenses_are_recorded_and_written_and_read_again_alike(tmp_path):
    scene, found = bent(exact_scene(), *BENT), refined_of_bent()
    kept = Refinement.of_facts(json.loads(json.dumps(found.facts())), found.cameras, found.iterations)
    assert [lens.distortion.tolist() for lens in kept.lenses if lens] == [
        lens.distortion.tolist() for lens in found.lenses if lens
    ]
    corrected = replace(with_cameras(scene, found.cameras, found.lenses), refinement=found)
    header = json.loads(json.dumps(header_of(corrected, PRESETS["accurate"])))
    again = with_recorded_cameras(scene, header)
    half = with_recorded_cameras(
        replace(
            scene, views=tuple(view.resized(view.camera.width // 2, view.camera.height // 2) for view in scene.views)
        ),
        header,
    )
    for ours, theirs, small in zip(corrected.views, again.views, half.views, strict=True):
        np.testing.assert_array_equal(ours.camera.image_from_world, theirs.camera.image_from_world)
        np.testing.assert_array_equal(ours.photo.load(), theirs.photo.load())
        reduced = ours.resized(*small.photo.size).photo.load()
        assert np.abs(small.photo.load()[5:-5, 5:-5].astype(float) - reduced[5:-5, 5:-5]).mean() < 1.5
    images = tmp_path / "images"
    images.mkdir()
    for view in scene.views:
        cv2.imwrite(str(images / f"{view.name}"), view.photo.load()[..., ::-1])
    write_text_model(tmp_path / "sparse", corrected.views, None, found.lenses)
    read = load_capture(tmp_path)
    assert len(read.views) == len(corrected.views)
    for ours, theirs in zip(corrected.views, read.views, strict=True):
        np.testing.assert_allclose(theirs.camera.image_from_world, ours.camera.image_from_world, rtol=1e-6, atol=1e-6)
        assert np.abs(theirs.photo.load().astype(int) - ours.photo.load()).max() <= 1


@pytest.mark.slow
def test_a_run_reads_the_undistorted_photos(tmp_path, monkeypatch):
    monkeypatch.setenv("EIGENFAIRING_CACHE", str(tmp_path))
    options = FairingOptions().with_levels(blur=(3.0,), max_sweeps=1)
    session = Session(replace(bent(exact_scene(), *BENT), cameras_choice="refine_lens", points_choice="none"), options)
    session.choose_inputs()
    assert session.scene.cameras_origin == "corrected"
    fresh = Session(session.scene, options)
    for run in (session, fresh):
        run.run()
    assert [step.energy_before for step in session.trace.steps] == [step.energy_before for step in fresh.trace.steps]
    np.testing.assert_array_equal(session.vertices, fresh.vertices)


@pytest.mark.slow
def test_points_follow_the_undistorted_photos():
    scene, found = bent(exact_scene(), *BENT), refined_of_bent()
    seen = find_points(scene.views)
    point = np.repeat(np.arange(len(seen)), seen.n_views)
    points = SparsePoints(seen.positions, seen.colors, np.column_stack([point, seen.photos]), seen.pixels)
    moved = found.corrected_points(points)
    assert moved is not None
    errors = []
    for p, cameras, pixels in (
        (points, [v.camera for v in scene.views], points.pixels),
        (moved, found.cameras, moved.pixels),
    ):
        shown = [cameras[v].project(p.positions[i])[0] for i, v in p.observations.tolist()]
        errors.append(np.median(np.linalg.norm(np.array(shown) - pixels, axis=1)))
    assert errors[1] < 0.6 * errors[0], errors


@pytest.mark.slow
def test_a_run_can_refine_intrinsics_too(tmp_path, monkeypatch):
    monkeypatch.setenv("EIGENFAIRING_CACHE", str(tmp_path))
    views = []
    for view in exact_scene().views:
        camera = view.camera
        K = camera.K * np.array([[1.01, 1, 1], [1, 1.01, 1], [1, 1, 1]])
        views.append(replace(view, camera=Camera(K @ camera.camera_from_world, camera.width, camera.height)))
    wrong = replace(exact_scene(), views=tuple(views))
    focal = {}
    for choice in ("refine", "refine_lens"):
        session = Session(replace(wrong, cameras_choice=choice))
        session.choose_inputs()
        focal[choice] = session.scene.views[0].camera.K[0, 0]
        focal["error", choice] = session.trace.header["refinement"]["held_out"]["error_after"]
    true, given = (scene.views[0].camera.K[0, 0] for scene in (exact_scene(), wrong))
    assert focal["refine"] == pytest.approx(given)
    assert abs(focal["refine_lens"] - true) < 0.3 * abs(given - true)
    assert focal["error", "refine_lens"] <= focal["error", "refine"]
