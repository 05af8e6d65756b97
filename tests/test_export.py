"""A recorded run as a picture, a video and a report; and every mistake as one line."""

import json
import re
import shutil
from html import unescape
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from app.cli.main import run
from app.export import picture, report_page, video
from app.export.captions import moment_words
from app.export.page_data import run_data
from app.export.run_facts import RunFacts
from app.files.recorded_run import find_run
from fairing.camera import Camera
from fairing.io import PhotoChoice
from fairing.run.session import Session
from fairing.texture import Drawing
from tests.small_scene import corner_scene, small_options, write_corner

QUICK = ["--schedule.blur", "2", "1", "--schedule.max-sweeps", "1", "--cells.size", "32"]
NAME = "a <b>corner & more"


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    write_corner(folder / NAME)
    assert run(["fair", str(folder / NAME), "--out", str(folder / "run"), "--left-out", *QUICK]) == 0
    return folder / "run"


@pytest.fixture(scope="module")
def facts(recorded) -> RunFacts:
    trace, source, path = find_run(recorded, None, None, PhotoChoice())
    return RunFacts(Session(source.load(), trace=trace), path.parent)


@pytest.fixture
def quick_video(monkeypatch):
    monkeypatch.setattr(video, "KEYFRAMES", 3)
    monkeypatch.setattr(video, "SECONDS", 1.0)
    monkeypatch.setattr(video, "HELD_SECONDS", 0.2)
    monkeypatch.setattr(video, "VIDEO_SIZE", (320, 240))


def one_line(capsys) -> str:
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1, lines
    return lines[0]


def test_a_drawing_shows_the_texture_where_rays_meet_the_mesh():
    rng = np.random.default_rng(5)
    K = np.array([[90.0, 0, 31.2], [0, 80.0, 25.7], [0, 0, 1]])
    camera = Camera.from_krt(K, np.eye(3), np.zeros(3), 64, 48)
    vertices = np.array([[-0.6, -0.5, 2.2], [0.7, -0.4, 3.4], [-0.2, 0.8, 2.9]])
    uv = np.array([[[0.1, 0.2], [0.9, 0.15], [0.3, 0.85]]])
    smooth = cv2.GaussianBlur(rng.uniform(0, 255, (80, 100, 3)).astype(np.float32), (0, 0), 12)
    image = np.clip(8 * (smooth - smooth.mean()) + 128, 0, 255).astype(np.uint8)
    drawn = Drawing(vertices, np.array([[0, 1, 2]]), camera).textured(uv, image, (1, 2, 3))
    # Independently: intersect the ray of each pixel with the plane, and read the texture at its barycentric coordinates.
    y, x = np.mgrid[:48, :64]
    rays = np.stack([x, y, np.ones_like(x)], axis=-1) @ np.linalg.inv(K).T
    normal = np.cross(vertices[1] - vertices[0], vertices[2] - vertices[0])
    points = rays * (normal @ vertices[0] / (rays @ normal))[..., None]
    weights = points @ np.linalg.inv(vertices)
    inside = (weights > 0.03).all(axis=-1)
    texel = (weights / weights.sum(-1, keepdims=True)) @ uv[0] * (100, 80) - 0.5
    read = cv2.remap(image, texel.astype(np.float32), None, cv2.INTER_LINEAR)
    assert inside.sum() > 300
    assert np.abs(drawn[inside].astype(int) - read[inside]).max() <= 6
    assert (drawn[(weights < -0.05).any(axis=-1)] == (1, 2, 3)).all()


@pytest.mark.slow
def test_the_picture_shows_the_mesh_before_and_after(recorded, facts, tmp_path):
    out = tmp_path / "picture.png"
    assert run(["export", str(recorded), "--out", str(out)]) == 0
    found = np.asarray(Image.open(out))
    side, height = picture.SIDE, len(found) - picture.CAPTION
    before, after = found[:height, :side], found[:height, -side:]
    moved = np.abs(before.astype(int) - after).max(axis=-1) > 40
    assert 0.002 < moved.mean() < 0.5
    at_end = picture.picture(facts, facts.length, lambda fraction: None)
    assert np.array_equal(at_end[:height], after)
    assert run(["export", str(recorded), "--out", str(out), "--at", "start"]) == 0
    assert np.array_equal(np.asarray(Image.open(out))[:height], before)


@pytest.mark.parametrize("name", ["run.mp4", "run.webm", "run.GIF"])
def test_a_video_shows_the_run_and_ends_with_its_result(name, recorded, facts, tmp_path, quick_video):
    out = tmp_path / name
    assert run(["export", str(recorded), "--out", str(out)]) == 0
    if name.endswith("GIF"):
        image = Image.open(out)
        frames = []
        for k in range(image.n_frames):
            image.seek(k)
            frames.append(np.asarray(image.convert("RGB")))
        width, height = video.GIF_SIZE
    else:
        reader = cv2.VideoCapture(str(out))
        frames = []
        while (found := reader.read())[0]:
            frames.append(found[1][..., ::-1])
        width, height = video.VIDEO_SIZE
    assert len(frames) > 5
    assert frames[0].shape == (height, width, 3)
    wanted = list(video.film(facts, width, height, 4, lambda fraction: None))
    mesh = slice(0, round((1 - video.CAPTION_SHARE) * height) - 2)
    start, end = wanted[0][mesh].astype(float), wanted[-1][mesh].astype(float)
    moved = np.abs(start - end).max(axis=-1) > 25
    assert moved.sum() > 100
    for found, right, wrong in ((frames[0], start, end), (frames[-1], end, start)):
        off = np.abs(found[mesh][moved] - right[moved]).mean()
        assert off < 0.35 * np.abs(found[mesh][moved] - wrong[moved]).mean()


def test_frames_pass_through_all_the_run_in_order(facts):
    moments = video.shown_moments(facts, 24)
    assert moments[0] == 0
    assert moments[-1] == facts.length
    assert (np.diff(moments) >= 0).all()
    assert (np.diff(moments) < 0.5 * facts.length).all()


def test_key_moments_are_start_end_and_moments_between_them_spread_by_motion(facts):
    assert facts.key_moments(2) == [0, facts.length]
    assert facts.key_moments(1000) == list(range(facts.length + 1))
    assert len(facts.key_moments(4)) <= 4
    assert (np.diff(facts.pace) > 0).all()


def test_a_run_in_which_nothing_could_move_is_exported_without_energies():
    session = Session(corner_scene(), small_options(locked_vertices=tuple(range(7))))
    session.run()
    facts = RunFacts(session)
    assert facts.length > 0
    assert not any("energy" in line for moment in range(facts.length + 1) for line in moment_words(facts, moment))
    data = run_data(facts)
    assert data["energy"] == []
    assert {step[key] for step in data["steps"] for key in ("before", "after")} == {None}
    assert "Energy by moment" not in report_page._curves(facts)


def test_the_report_says_what_report_json_says(recorded, tmp_path):
    out = tmp_path / "report.html"
    report = json.loads((recorded / "report.json").read_text())
    copy = tmp_path / "run"
    shutil.copytree(recorded, copy)
    extras = {"warnings": ["<script>alert(1)</script>"]}
    report["left_out"]["photos"][3] |= {"photo": "photo<i>7", "ssim_after": None}
    (copy / "report.json").write_text(json.dumps(report | extras))
    assert run(["export", str(copy), "--out", str(out), "--report"]) == 0
    page = out.read_text()
    words = unescape(re.sub(r"<[^>]*>", "|", page))
    for sweep in report["sweeps"]:
        assert f"|{sweep['blur_px']:g} px|" in words
    total = sum(sweep["accepted"] for sweep in report["sweeps"] if sweep["level"] == 1)
    assert f"|{total}|" in words
    assert f"Time: {report['seconds']['total']:.1f} s" in words
    assert report["versions"]["numpy"] in words
    assert "all 2 levels done" in words
    for photo in report["left_out"]["photos"]:
        assert f"|{photo['psnr_before']:.2f}||{photo['psnr_after']:.2f}|" in words
    assert page.count("data:image/jpeg;base64,") == 3  # before, after, photos left out
    for value in (NAME, report["left_out"]["photos"][3]["photo"], *extras["warnings"]):
        assert value in unescape(page)
        assert value not in page
    assert "src='http" not in page
    assert "<script" not in page


def test_without_report_json_the_report_is_made_from_the_record(recorded, tmp_path):
    (tmp_path / "run.trace").write_bytes((recorded / "run.trace").read_bytes())
    assert run(["export", str(tmp_path / "run.trace"), "--out", str(tmp_path / "r.html"), "--report"]) == 0
    page = (tmp_path / "r.html").read_text()
    assert "all 2 levels done" in page
    assert "Time:" not in page


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (["--out", "run.avi"], "--out run.avi: expected a file ending in .html, .png, .mp4, .webm, .gif"),
        (["--out", "run"], "--out run: expected a file ending in"),
        (["--out", "nowhere/run.png"], "there is no folder nowhere; create it first"),
        (["--out", "run.mp4", "--at", "end"], "--at: a video or a report shows the whole run"),
        (["--out", "run.png", "--report"], "--report: expected --out to end in .html, found run.png"),
        (["--out", "run.png", "--at", "9:1:1:1"], "expected a level from 1 to 2, found 9"),
    ],
)
def test_a_mistake_is_one_line_and_writes_nothing(flags, said, recorded, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run(["export", str(recorded), *flags]) == 1
    assert said in one_line(capsys)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("content", ["{", "[]", '{"format": "eigenfairing report 1"}'])
def test_a_broken_report_is_one_line(content, recorded, tmp_path, capsys):
    (tmp_path / "run.trace").write_bytes((recorded / "run.trace").read_bytes())
    (tmp_path / "report.json").write_text(content)
    assert run(["export", str(tmp_path), "--out", str(tmp_path / "r.html"), "--report"]) == 1
    assert "report.json: expected the report of a run" in one_line(capsys)
    assert not (tmp_path / "r.html").exists()


def test_cancelling_leaves_nothing_behind(recorded, tmp_path, monkeypatch, capsys):
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(video.KeyframeRenderer, "draw", interrupt)
    assert run(["export", str(recorded), "--out", str(tmp_path / "run.mp4")]) == 130
    assert list(tmp_path.iterdir()) == []
