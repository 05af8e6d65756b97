"""Photos alone: the folder, its photos prepared, the child process, and the capture that is written."""

import json
import os
import sys
import threading
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from PIL import ExifTags, Image

from app.cli.main import run
from demo_scenes import load_demo
from fairing.errors import Cancelled, InputError
from fairing.image_file import decode_image
from fairing.io import read_capture
from fairing.scene import SparsePoints
from fairing.structure import child, reconstruction
from fairing.structure.options import StructureOptions
from fairing.structure.outcome import nothing_placed, reasons_for_missing
from fairing.structure.pairs import MOST_EXHAUSTIVE, NEIGHBOURS, pairs_to_match, similar_pairs
from fairing.structure.photo_set import read_photo_set
from fairing.structure.preparation import prepare_photos, prepared_name
from fairing.structure.reconstruction import capture_of_photos
from fairing.structure.worker import FACTS, JOB, MODEL
from tests.synthetic_capture import SyntheticCapture

NOISE = np.random.default_rng(0).integers(0, 256, (60, 80, 3), dtype=np.uint8)
without_pycolmap = pytest.mark.skipif(
    find_spec("pycolmap") is None, reason="pycolmap is not installed; the extra `photos` has it"
)


def save(path: Path, pixels: np.ndarray = NOISE, focal_35: int | None = None, orientation: int | None = None) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    exif = Image.Exif()
    if orientation is not None:
        exif[ExifTags.Base.Orientation] = orientation
    if focal_35 is not None:
        exif[ExifTags.Base.Make], exif[ExifTags.Base.Model] = "Maker", "Phone 9"
        exif[ExifTags.IFD.Exif] = {ExifTags.Base.FocalLengthIn35mmFilm: focal_35}
    Image.fromarray(pixels).save(path, exif=exif)


def test_photos_of_one_camera_share_it_and_its_focal_length(tmp_path: Path):
    for name, focal_35 in (("a.jpg", 26), ("b.png", 26), ("c.jpg", 52), ("d.jpg", None)):
        save(tmp_path / name, focal_35=focal_35)
    save(tmp_path / "e.jpg", focal_35=26, orientation=6)
    (tmp_path / "f.jpg").write_bytes(b"no photo")
    photos = read_photo_set(tmp_path)
    assert photos.cameras == [[0, 1], [2], [3], [4]]
    assert [photo.name for photo in photos.photos] == ["a.png", "b.png", "c.png", "d.png", "e.png"]
    assert photos.photos[4].size == (60, 80)
    # CIPA DCG-001: the 35 mm equivalent has the same angle across the diagonal, 43.27 mm.
    assert photos.photos[0].focal_length((1600, 1200)) == pytest.approx(26 / 43.2666 * 2000, rel=1e-4)
    assert photos.photos[3].focal_length((1600, 1200)) is None
    assert list(photos.unreadable) == ["f.jpg"]
    assert "is not an image file" in photos.unreadable["f.jpg"]


def test_two_photos_are_too_few(tmp_path: Path):
    save(tmp_path / "a.jpg")
    save(tmp_path / "b.jpg")
    with pytest.raises(InputError, match="expected at least 3 photos, found 2"):
        read_photo_set(tmp_path)
    with pytest.raises(InputError, match="expected a folder of photos, found a file"):
        read_photo_set(tmp_path / "a.jpg")


def test_prepared_photos_are_upright_reduced_and_masked(tmp_path: Path):
    gradient = np.repeat(np.arange(80, dtype=np.uint8)[None, :, None] * 3, 60, axis=0).repeat(3, axis=2)
    for name in ("a.png", "b.png", "c.png"):
        save(tmp_path / "photos" / name, gradient, orientation=6 if name == "a.png" else None)
    black_left = np.full((60, 80), 255, np.uint8)
    black_left[:, :20] = 0
    save(tmp_path / "masks" / "b.png", black_left)
    photos = read_photo_set(tmp_path)
    done: list[int] = []
    damaged = prepare_photos(photos, tmp_path, tmp_path / "work", 40, done.append, lambda: False)
    assert (damaged, done) == ({}, [1, 2, 3])
    turned = decode_image(tmp_path / "work" / "images" / prepared_name(0)).pixels
    assert turned.shape == (40, 30, 3)
    assert (np.diff(turned[:, 0, 0].astype(int)) >= 0).all(), "tag 6: the left end is on top"
    mask = decode_image(tmp_path / "work" / "masks" / f"{prepared_name(1)}.png").pixels
    assert mask.shape == (30, 40)
    assert not mask[:, :10].any()
    assert mask[:, 10:].all()


def test_few_photos_are_matched_exhaustively_and_many_with_those_that_look_alike():
    assert len(pairs_to_match(MOST_EXHAUSTIVE, lambda i: pytest.fail("not needed"))) == MOST_EXHAUSTIVE * 79 // 2
    rng = np.random.default_rng(1)
    places = rng.integers(0, 256, (4, 300, 128))
    n = 4 * 30

    def descriptors(i: int) -> np.ndarray:  # photo i shows place i mod 4
        return np.clip(places[i % 4] + np.random.default_rng(i).integers(-8, 9, (300, 128)), 0, 255).astype(np.uint8)

    pairs = pairs_to_match(n, descriptors)
    assert pairs == pairs_to_match(n, descriptors)
    assert all(i < j for i, j in pairs)
    assert {(i, j) for i in range(n) for j in range(i + 1, min(i + 1 + NEIGHBOURS, n))} <= set(pairs)
    assert all(i % 4 == j % 4 for i, j in similar_pairs([descriptors(i) for i in range(n)]))
    assert similar_pairs([np.zeros((0, 128), np.uint8)] * 3) == set()


def test_every_photo_that_is_not_placed_has_a_reason():
    facts = {
        "features": {"0": 900, "1": 900, "2": 900, "3": 40, "4": 800, "5": 700, "6": 700, "7": 700},
        "pairs": [[0, 1, 80], [1, 2, 70], [2, 5, 17], [5, 0, 16], [6, 7, 300]],
        "groups": [[0, 1, 2], [6, 7]],
    }
    names = [f"{i}.jpg" for i in range(8)]
    reasons = reasons_for_missing(facts, names)
    assert list(reasons) == [3, 4, 5, 6, 7]
    assert reasons[3] == "only 40 features: blank, blurred or too small"
    assert reasons[4] == "shows nothing that another photo shows from a similar place"
    assert reasons[5] == "too few matches with placed photos (at most 17, with 2.jpg)"
    assert reasons[6] == reasons[7] == "belongs to a group of 2 photos that no photo joins to the others"
    assert "6 of 9 photos match another (at most 300 features)" in nothing_placed(facts, 9)


def fake_worker(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, body: str) -> Path:
    """A working folder, and a script in place of the worker, which has `tell` and `work`."""
    script = tmp_path / "fake.py"
    script.write_text(
        "import json, os, signal, sys, time\nfrom pathlib import Path\nwork = Path(sys.argv[1])\n"
        "def tell(**content):\n    print(json.dumps(content), flush=True)\n" + body
    )
    monkeypatch.setattr(child, "COMMAND", (sys.executable, str(script)))
    work = tmp_path / "work"
    work.mkdir(exist_ok=True)
    return work


def test_progress_of_the_child_never_falls_and_ends_at_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    work = fake_worker(
        tmp_path,
        monkeypatch,
        "print('pycolmap prints this')\n"
        "for stage, count in (('features', 4), ('pairs', 4), ('matches', 6), ('mapping', 4)):\n"
        "    tell(stage=stage, count=count)\n"
        "    for done in range(1, count + 1):\n"
        "        tell(done=done)\n"
        "(work / 'facts.json').write_text('{\"groups\": []}')\n"
        "tell(finished=True)\n",
    )
    shown: list[tuple[float, str]] = []
    facts = child.place_photos(work, 4, 6, lambda *line: shown.append(line), lambda: False)
    assert facts == {"groups": []}
    fractions = [fraction for fraction, _ in shown]
    assert fractions == sorted(fractions)
    assert fractions[-1] == pytest.approx(1)
    assert shown[0][1] == "finding features: photo 0 of 4"
    assert shown[-1][1] == "placing cameras: 4 of 4"


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        ("tell(stage='matches', count=3)\nos.kill(os.getpid(), signal.SIGSEGV)", "ended unexpectedly .SIGSEGV. while matching"),
        ("tell(stage='mapping', count=3)\ntell(error='ValueError: no')", "failed while placing cameras: ValueError: no"),
        ("raise ImportError('no such library')", "ended unexpectedly .exit code 1. while starting"),
    ],
)  # fmt: skip
def test_a_crash_of_native_code_is_one_line(
    body: str, expected: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
):
    work = fake_worker(tmp_path, monkeypatch, f"print('noise')\nprint('more', file=sys.stderr)\n{body}\n")
    with pytest.raises(InputError, match=expected):
        child.place_photos(work, 4, 6, lambda *line: None, lambda: False)
    assert capfd.readouterr() == ("", "")
    assert "more" in (work / "pycolmap.log").read_text()


def test_a_cancelled_child_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    work = fake_worker(
        tmp_path,
        monkeypatch,
        "(work / 'pid').write_text(str(os.getpid()))\ntell(stage='features', count=3)\ntime.sleep(60)\n",
    )
    cancelled = threading.Event()
    with pytest.raises(Cancelled):
        child.place_photos(work, 4, 6, lambda *line: cancelled.set(), cancelled.is_set)
    with pytest.raises(ProcessLookupError):
        os.kill(int((work / "pid").read_text()), 0)


SYNTHETIC = SyntheticCapture("SIMPLE_RADIAL", names=tuple(f"{name}.jpg" for name in "abcde"), n_points=60)


def placing(lost: int) -> Callable[..., dict]:
    """In place of the worker: the cameras of `SYNTHETIC`, without those of a photo."""

    def place(work: Path, n_photos: int, n_pairs: int, on_progress: Callable, cancel_requested: Callable) -> dict:
        job = json.loads((work / JOB).read_text())
        assert [camera["photos"] for camera in job["cameras"]] == [[0, 1, 2, 3, 4]]
        for done in range(n_photos):
            on_progress(done / n_photos, f"placing cameras: {done} of {n_photos}")
            if cancel_requested():
                raise Cancelled
        SYNTHETIC.write_text(work / MODEL)
        lines = (work / MODEL / "images.txt").read_text().splitlines()
        del lines[1 + 2 * lost : 3 + 2 * lost]
        text = "\n".join(lines)
        for i, name in enumerate(SYNTHETIC.names):
            text = text.replace(f" 7 {name}", f" 7 {prepared_name(i)}")
        (work / MODEL / "images.txt").write_text(text)
        kept = [i for i in range(5) if i != lost]
        facts = {
            "features": {str(i): 500 for i in range(5)}, "pairs": [[0, 1, 99], [1, lost, 16]], "groups": [kept],
            "focal_lengths": [110.0], "reprojection": 0.1234, "pycolmap": "0",
        }  # fmt: skip
        (work / FACTS).write_text(json.dumps(facts))
        return facts

    return place


@pytest.fixture
def photos(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of photos whose cameras `capture_of_photos` finds without pycolmap, but for the last one's."""
    folder = tmp_path / "phone"
    SYNTHETIC.write_photos(folder)
    monkeypatch.setattr(reconstruction, "check_pycolmap", lambda *_: None)
    monkeypatch.setattr(reconstruction, "place_photos", placing(lost=4))
    return folder


def test_the_capture_has_undistorted_photos_under_their_names_and_cameras_that_fit(photos: Path, tmp_path: Path):
    shown: list[float] = []
    out = tmp_path / "capture"
    placed = capture_of_photos(photos, out, on_progress=lambda fraction, line: shown.append(fraction))
    assert placed.placed == ("a.png", "b.png", "c.png", "d.png")
    assert placed.left_out == {"e.jpg": "too few matches with placed photos (at most 16, with b.jpg)"}
    assert any("left out: e.jpg: too few matches" in line for line in placed.lines())
    assert shown == sorted(shown)
    assert sorted(path.name for path in out.iterdir()) == [".eigenfairing", "cameras.json", "images", "sparse"]
    capture = read_capture(out)
    assert [view.name for view in capture.views] == list(placed.placed)
    points = capture.sparse_points
    assert isinstance(points, SparsePoints)
    for v, view in enumerate(capture.views):
        mine = points.observations[:, 1] == v
        uv, depth = view.camera.project(points.positions[points.observations[mine, 0]])
        assert (depth > 0).all()
        np.testing.assert_allclose(uv, points.pixels[mine], atol=1e-6)
    again = capture_of_photos(photos, out, on_progress=lambda *_: pytest.fail("it is finished"))
    assert again == placed
    copied = capture_of_photos(photos, tmp_path / "copy", reuse=out)
    assert copied == placed
    assert len(read_capture(tmp_path / "copy").views) == 4


def test_a_cancelled_capture_continues_and_other_photos_begin_anew(photos: Path, tmp_path: Path):
    out, asked = tmp_path / "capture", []

    def cancels() -> bool:
        asked.append(1)
        return len(asked) > 7  # the five photos are prepared

    with pytest.raises(Cancelled):
        capture_of_photos(photos, out, cancel_requested=cancels)
    prepared = out / "work" / "images" / prepared_name(2)
    before = prepared.stat().st_mtime_ns
    with pytest.raises(InputError, match="expected one of"):
        read_capture(out)
    with pytest.raises(Cancelled):
        capture_of_photos(photos, out, cancel_requested=lambda: len(asked) > 7)
    assert prepared.stat().st_mtime_ns == before
    os.utime(photos / "c.jpg", ns=(1, 1))
    assert len(capture_of_photos(photos, out).placed) == 4
    assert not (out / "work").exists()


def test_a_folder_of_the_user_is_never_written_to(photos: Path):
    with pytest.raises(InputError, match="expected an empty or new folder for the results"):
        capture_of_photos(photos, photos)
    assert sorted(path.name for path in photos.iterdir()) == list(SYNTHETIC.names)


def test_photos_without_overlap_are_one_line(photos: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    facts = {"features": {}, "pairs": [], "groups": []}
    monkeypatch.setattr(reconstruction, "place_photos", lambda *_: facts)
    with pytest.raises(InputError, match=r"phone: expected photos that overlap.*0 of 5 photos match another"):
        capture_of_photos(photos, tmp_path / "capture")


def test_without_pycolmap_one_line_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys):
    SYNTHETIC.write_photos(tmp_path / "phone")
    monkeypatch.setattr(reconstruction.importlib.util, "find_spec", lambda name: None)
    monkeypatch.setenv("EIGENFAIRING_CACHE", str(tmp_path / "cache"))
    phone, out = str(tmp_path / "phone"), str(tmp_path / "out")
    for command in (["cameras", phone, "--out", out], ["fair", phone, "--out", out], ["check", phone],
                    ["view", phone, "--no-browser", "--port", "0"]):  # fmt: skip
        assert run(command) == 1
        said = capsys.readouterr()
        assert said.err.splitlines()[-1].endswith('needs pycolmap: `pip install "eigenfairing[photos]"`')
        assert "http://" not in said.out, "the page was announced before"


@without_pycolmap
@pytest.mark.slow
def test_cameras_of_the_demo_cube_are_found_from_its_photos_alone(tmp_path: Path):
    """Real pycolmap, in its process. A focal length of 820 px has a 35 mm equivalent of 44.35 mm, noted as 44."""
    scene = load_demo("cube")
    views = scene.views[::2]
    for i, view in enumerate(views):
        exif = Image.Exif()
        exif.get_ifd(ExifTags.IFD.Exif)[ExifTags.Base.FocalLengthIn35mmFilm] = 44
        (tmp_path / "phone").mkdir(exist_ok=True)
        Image.fromarray(view.photo.load()).save(tmp_path / "phone" / f"{i}.png", exif=exif)
    out = tmp_path / "capture"
    placed = capture_of_photos(tmp_path / "phone", out, StructureOptions(threads=1))
    assert len(placed.placed) == len(views)
    assert placed.reprojection < 0.6
    assert placed.focal_lengths[0] == pytest.approx(820, rel=0.05)
    found = np.array([view.camera.center for view in read_capture(out).views])
    given = np.array([view.camera.center for view in views])
    error = residual_of_similarity(found, given)
    assert error < 0.02 * np.linalg.norm(np.ptp(given, axis=0)), error


def residual_of_similarity(found: np.ndarray, given: np.ndarray) -> float:
    """Rms distance of points (n, 3) after the best similarity (Umeyama 1991)."""
    x, y = found - found.mean(axis=0), given - given.mean(axis=0)
    U, S, Vt = np.linalg.svd(y.T @ x)
    D = np.diag([1, 1, np.sign(np.linalg.det(U @ Vt))])
    scale = np.trace(np.diag(S) @ D) / (x**2).sum()
    return float(np.sqrt(((y - scale * x @ (U @ D @ Vt).T) ** 2).sum(axis=1).mean()))
