"""Memory: photos stored by a run, the memory estimate, and the warning for runs that do not fit."""

import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from app.cli.main import run
from fairing.cells.scale_space import LUMA, ScaleSpace, reduction
from fairing.check import memory
from fairing.check.memory import memory_needed, memory_warning
from fairing.check.scene_check import check_scene
from fairing.errors import Cancelled
from fairing.image_file import decode_image
from fairing.options import PRESETS
from fairing.photo import FilePhoto, ResizedPhoto
from fairing.run.session import Session
from fairing.solve.problem import TOO_MANY_PARTS, Problem
from fairing.util.bounded_cache import BoundedCache
from tests.small_scene import HEIGHT, VERTICES, WIDTH, corner_scene, small_options, write_corner

GIGABYTE = 10**9


def test_two_threads_can_lay_out_photos_at_once(monkeypatch: pytest.MonkeyPatch):
    """As in a local search that evaluates two directions: photos added to the reserved part do not disturb others."""
    shared, alone = (ScaleSpace(corner_scene(), color=False) for _ in range(2))
    blurred = ScaleSpace._blurred
    with ThreadPoolExecutor(2) as pool, ThreadPoolExecutor(2) as both:
        shared.lay_out(1.2, False, [(view, blur) for view in range(8) for blur in (1.2, 1.9)], pool)
        monkeypatch.setattr(ScaleSpace, "_blurred", lambda *call: time.sleep(0.05) or blurred(*call))
        jobs = [(3, 1.5), (5, 1.7)]
        laid_out = list(both.map(lambda wanted: shared.lay_out(1.2, False, [wanted], pool), jobs))
        for wanted, (pixels, starts) in zip(jobs, laid_out, strict=True):
            expected, _ = alone.lay_out(0.0, False, [wanted], pool)
            assert np.array_equal(pixels[starts[wanted] :][: WIDTH * HEIGHT], expected[-WIDTH * HEIGHT :])


def test_only_requested_photos_are_laid_out_and_later_ones_do_not_change_them(monkeypatch: pytest.MonkeyPatch):
    photos, size = ScaleSpace(corner_scene(), color=False), WIDTH * HEIGHT
    with ThreadPoolExecutor(2) as pool:
        few, starts = photos.lay_out(1.2, False, [(3, 1.2), (1, 1.9)], pool)
        assert len(few) == 2 * size
        more, later = photos.lay_out(1.2, False, [(3, 1.2), (0, 1.2), (3, 1.9)], pool)
        assert len(more) == 4 * size
        monkeypatch.setattr("fairing.cells.scale_space.MEMORY", 0)
        anew, third = ScaleSpace(corner_scene(), color=False).lay_out(1.2, False, [(3, 1.2)], pool)
    np.testing.assert_array_equal(few[starts[3, 1.2] :][:size], more[later[3, 1.2] :][:size])
    np.testing.assert_array_equal(anew[third[3, 1.2] :][:size], more[later[3, 1.2] :][:size])
    assert not np.array_equal(more[later[3, 1.9] :][:size], more[later[3, 1.2] :][:size])


def small_reductions(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the photos of the corner be reduced as those of a large scene."""
    monkeypatch.setattr("fairing.cells.scale_space.MEMORY", 0)
    monkeypatch.setattr("fairing.cells.scale_space.MIN_REDUCED_SIZE", 8)


def test_a_reduced_photo_is_a_subset_of_the_pixels_of_the_blurred_one(monkeypatch: pytest.MonkeyPatch):
    """It is blurred in several steps where it is reduced by more than 2."""
    wanted = [(0, 1.9), (0, 2.0), (0, 5.0), (0, 9.6)]
    small_reductions(monkeypatch)
    photos = ScaleSpace(corner_scene(), color=False)
    photo = corner_scene().views[0].photo.load() @ LUMA
    with ThreadPoolExecutor(1) as pool:
        kept, starts = photos.lay_out(1.2, False, wanted, pool)
    for (view, sigma), factor in zip(wanted, (1, 2, 4, 8), strict=True):
        width, height = photos.size_at(view, sigma, 1.2)
        assert (width, height) == (WIDTH // factor, HEIGHT // factor)
        small = kept[starts[view, sigma] :][: width * height].reshape(height, width)
        whole = gaussian_filter(photo, sigma, mode="mirror")
        assert np.abs(small - whole[::factor, ::factor]).max() < 0.01 * np.ptp(photo)


def test_only_large_scenes_reduce_the_photos_of_a_level_itself():
    size = (1000, 800)
    assert [reduction(size, 6.0, 6.0, is_large) for is_large in (False, True)] == [1, 4]
    assert [reduction(size, sigma, 1.2, False) for sigma in (1.2, 2.4, 4.8, 9.6)] == [1, 1, 2, 4]
    assert reduction(size, 100.0, 1.2, True) == 8, "800 / 16 px would be less than 64"


def test_what_is_stored_of_a_photo_does_not_depend_on_what_was_asked_for_before(monkeypatch: pytest.MonkeyPatch):
    small_reductions(monkeypatch)
    together, alone = (ScaleSpace(corner_scene(), color=False) for _ in range(2))
    with ThreadPoolExecutor(1) as pool:
        together.lay_out(1.2, False, [(0, 2.4), (0, 4.8)], pool)
        pixels, starts = together.lay_out(1.2, False, [(0, 9.6)], pool)
        expected, _ = alone.lay_out(1.2, False, [(0, 9.6)], pool)
    np.testing.assert_array_equal(pixels[starts[0, 9.6] :], expected)


def test_photos_of_later_levels_are_kept_and_those_of_earlier_ones_freed(monkeypatch: pytest.MonkeyPatch):
    photos, blurs = ScaleSpace(corner_scene(), color=False), (2.0, 1.2, 0.5)
    with ThreadPoolExecutor(1) as pool:

        def anew(blur: float) -> bool:
            """Whether the photos of a blur are computed."""
            with monkeypatch.context() as patch:
                calls, blurred = [], ScaleSpace._blurred
                patch.setattr(ScaleSpace, "_blurred", lambda *call: calls.append(call) or blurred(*call))
                photos.lay_out(blur, False, [(0, blur)], pool)
            return bool(calls)

        assert [anew(blur) for blur in blurs] == [True, True, True]
        photos.begin_level(1.2)
        assert [anew(blur) for blur in blurs] == [True, False, False]
        monkeypatch.setattr("fairing.cells.scale_space.KEPT_BYTES", 0)
        photos.begin_level(1.2)
        assert [anew(blur) for blur in blurs] == [True, False, True]


def test_reduced_photos_lead_to_the_same_position(monkeypatch: pytest.MonkeyPatch):
    """A photo pixel is 1.7 % of the edge; an error of half a reduced pixel would be as large."""
    options = small_options(
        locked_vertices=(1, 2, 3, 4, 5, 6), cells={"point_spread": ["as_seen"]},
        schedule={"blur": [2.0], "max_sweeps": [6]},
    )  # fmt: skip
    ends, sizes = [], []
    for prepare in (lambda _: None, small_reductions):
        prepare(monkeypatch)
        session = Session(corner_scene(), options)
        session.run()
        ends.append(session.vertices[0])
        sizes.append(len(session.sweep_state().context.kernel.pixels))
    assert sizes[0] == 4 * sizes[1]
    assert np.linalg.norm(ends[1] - ends[0]) < 0.004
    assert np.linalg.norm(ends[1] - VERTICES[0]) < 0.012


def test_a_scene_with_reduced_photos_needs_less_memory(monkeypatch: pytest.MonkeyPatch):
    scene = corner_scene()
    options = small_options(cells={"point_spread": ["as_seen"]}, schedule={"blur": [6.0]})
    monkeypatch.setattr(memory, "PROGRAM", 0)
    monkeypatch.setattr(memory, "KEPT_BYTES", 0)
    needed = memory_needed(scene, options)
    small_reductions(monkeypatch)
    pixels = sum(view.camera.width * view.camera.height for view in scene.views)
    assert needed - memory_needed(scene, options) == pytest.approx(4 * pixels * (1 - 1 / 16), abs=1)


@pytest.mark.parametrize("call", ["_blurred", "mask"])  # while photos are read, and while visibility is judged
def test_a_cancelled_run_stops_between_two_photos(call: str, monkeypatch: pytest.MonkeyPatch):
    scene, seen = corner_scene(), []
    problem = Problem(scene, small_options(threads=1), scene.mesh.vertices, cancel_requested=lambda: len(seen) == 3)
    before = getattr(ScaleSpace, call)

    def counted(*arguments):
        seen.append(arguments)
        return before(*arguments)

    monkeypatch.setattr(ScaleSpace, call, counted)
    with pytest.raises(Cancelled):
        problem.context(0, scene.mesh.vertices)
    assert len(seen) == 3
    seen.append(None)  # no longer cancelled
    expected = Problem(scene, small_options(), scene.mesh.vertices).context(0, scene.mesh.vertices)
    np.testing.assert_array_equal(problem.context(0, scene.mesh.vertices).kernel.pixels, expected.kernel.pixels)


def test_a_check_lays_out_no_photo_and_counts_the_views_of_a_run(monkeypatch: pytest.MonkeyPatch):
    scene = corner_scene()
    expected = Problem(scene, PRESETS["accurate"], scene.mesh.vertices).context(4, scene.mesh.vertices)
    monkeypatch.setattr(ScaleSpace, "_photo", lambda *_: pytest.fail("a photo was laid out"))
    check = check_scene(scene)
    np.testing.assert_array_equal(check.faces.n_views, expected.n_views)


def test_with_too_many_patch_pixels_the_last_level_reads_whole_photos_and_warns(monkeypatch: pytest.MonkeyPatch):
    scene, options = corner_scene(), PRESETS["accurate"]
    start, last = scene.mesh.vertices, options.n_levels - 1
    problem = Problem(scene, options, start)
    parts = problem.context(last, start).kernel
    assert (parts.pair_frame[:, 2] < WIDTH).any()
    assert TOO_MANY_PARTS not in problem.warnings
    monkeypatch.setattr("fairing.cells.scale_space.MEMORY", 0)
    whole = problem.context(last, start).kernel
    assert (whole.pair_frame == (0, 0, WIDTH, HEIGHT)).all()
    assert len(whole.pixels) == len(scene.views) * WIDTH * HEIGHT
    assert problem.warnings.count(TOO_MANY_PARTS) == 1


def test_more_and_larger_photos_and_faces_need_more_memory():
    scene, options = corner_scene(), PRESETS["accurate"]
    needed = memory_needed(scene, options)
    pixels = sum(view.camera.width * view.camera.height for view in scene.views)
    assert needed > 6 * pixels
    assert memory_needed(scene, options, scale=2) - needed >= 3 * 6 * pixels
    assert memory_needed(scene, options, scale=0.5) < needed


def test_a_reduced_photo_is_decoded_once_and_kept_without_the_whole_one(tmp_path, monkeypatch: pytest.MonkeyPatch):
    decoded = []
    monkeypatch.setattr("fairing.photo.decode_image", lambda path: decoded.append(path) or decode_image(path))
    monkeypatch.setattr("fairing.photo._LOADED", BoundedCache(max_bytes=3 * WIDTH * HEIGHT - 1))
    write_corner(tmp_path / "corner")
    photo = ResizedPhoto(FilePhoto(tmp_path / "corner" / "images" / "photo0.png"), (WIDTH // 2, HEIGHT // 2))
    np.testing.assert_array_equal(photo.load(), photo.load())
    assert len(decoded) == 1


def test_reduced_photos_need_the_memory_to_decode_the_whole_ones(monkeypatch: pytest.MonkeyPatch):
    """`--photo-scale` saves the work on photos, not their decoding."""
    scene, options = corner_scene(), small_options()
    tiny = replace(scene, views=tuple(view.resized(8, 6) for view in scene.views))
    pixels = memory.MAX_CONCURRENT_PHOTOS * WIDTH * HEIGHT
    monkeypatch.setattr("os.cpu_count", lambda: 8)
    monkeypatch.setattr(memory, "PROGRAM", 0)
    monkeypatch.setattr(memory, "PER_FACE", 0)
    assert memory_needed(tiny, options) > memory.PER_PIXEL_DECODED * pixels


@pytest.mark.parametrize(("total", "free", "code"), [(GIGABYTE // 10, GIGABYTE // 10, 1), (8 * GIGABYTE, 10_000, 0)])
def test_a_run_that_does_not_fit_is_refused_in_one_line(
    tmp_path, capsys, monkeypatch: pytest.MonkeyPatch, total: int, free: int, code: int
):
    write_corner(tmp_path / "corner")
    monkeypatch.setattr(memory, "memory_available", lambda: (total, free))
    arguments = ["fair", str(tmp_path / "corner"), "--out", str(tmp_path / "out"), "--schedule.blur", "1.2"]
    assert run(arguments) == code
    lines = [line for line in capsys.readouterr().err.splitlines() if "GB of memory" in line]
    assert len(lines) == 1
    assert ("this machine has 0.1 GB" in lines[0]) == (code == 1)
    assert (tmp_path / "out").exists() == (code == 0)


def test_the_remedy_is_a_scale_that_fits(monkeypatch: pytest.MonkeyPatch):
    scene, options = corner_scene(), PRESETS["accurate"]
    monkeypatch.setattr(memory, "PROGRAM", 0)
    monkeypatch.setattr(memory, "memory_available", lambda: (memory_needed(scene, options) - 1,) * 2)
    warning = memory_warning(scene, options)
    assert warning is not None
    assert warning.is_too_much
    scale = float(warning.line.rsplit("--photo-scale ", 1)[1])
    assert memory_needed(scene, options, scale) <= memory.USABLE_PART * (memory_needed(scene, options) - 1)
    monkeypatch.setattr(memory, "memory_available", lambda: None)
    assert memory_warning(scene, options) is None
