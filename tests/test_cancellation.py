"""Cancellation: how much work lies between two checks of the flag, counted in work units, on machines of any speed.

Every thread counts what it computes: cell samples, photo and patch pixels, rays, calls of Python functions. A check of the
flag in that thread (`Session.cancel_requested`) sets its counts to zero. Divided by the rates of one thread of an ordinary
machine they give seconds; the longest way between two checks is the latency of a cancellation.
"""

import sys
import threading
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scipy.fft

import fairing.cells.sample_masks
import fairing.cells.visibility
import fairing.geometry.closest_point
import fairing.optimize.iteration
import fairing.run.sweep
import fairing.solve.energy
from demo_scenes import load_demo
from fairing.camera import Camera
from fairing.cells.scale_space import ScaleSpace
from fairing.options import PRESETS, FairingOptions
from fairing.run.session import Session
from fairing.scene import Scene
from fairing.terms.point_rays import PointRays
from tests.rough_scene import SHARP_AT_LAST, rough_options, rough_scene
from tests.small_scene import corner_scene, small_options

LIMIT = 0.3  # s between two checks in a thread
RATES = {"samples": 1e8, "mask samples": 3e7, "photo px": 1e7, "depth px": 1e7, "patch px": 5e6, "rays": 2e5, "points": 1e5,
         "faces": 1e6, "coordinates": 1e5, "calls": 1e6}  # fmt: skip
"""Work units a second in one thread; lower than measured (ledger: work between two checks)."""


class Meter:
    """Counts the work of every thread since the last check in it.

    Attributes:
        longest: s, the largest sum of counts over their rates between two checks, with the counts.
        total: work units in all.
    """

    def __init__(self) -> None:
        self._counts: dict[int, dict[str, float]] = defaultdict(lambda: defaultdict(float))
        self.longest: tuple[float, dict[str, float]] = (0.0, {})
        self.total: dict[str, float] = defaultdict(float)

    def add(self, kind: str, units: float) -> None:
        counts = self._counts[threading.get_ident()]
        counts[kind] += units
        self.total[kind] += units
        seconds = sum(count / RATES[kind] for kind, count in counts.items())
        if seconds > self.longest[0]:
            self.longest = (seconds, dict(counts))

    def check(self) -> bool:
        """The flag: never set."""
        self._counts[threading.get_ident()].clear()
        return False

    def wrap(self, patch: pytest.MonkeyPatch, owner: Any, name: str, kind: str, units: Callable[..., float]) -> None:
        """Count the units of every call of a function or method."""
        original = getattr(owner, name)

        def counted(*arguments: Any, **named: Any) -> Any:
            self.add(kind, units(*arguments))
            return original(*arguments, **named)

        patch.setattr(owner, name, counted)

    def calls(self, frame: Any, event: str, argument: object) -> None:
        """A profile function: counts calls of Python functions of the engine."""
        if event == "call" and "/fairing/" in frame.f_code.co_filename:
            self.add("calls", 10)  # with what they call in numpy and Python


def kernel_samples(data: Any, vertices: np.ndarray, faces: np.ndarray, *_: object) -> float:
    counts = np.diff(data.pair_start)[faces] * np.diff(data.grid_start)[data.face_grid[faces]]
    return float(counts.sum()) * data.channels


def depth_pixels(vertices: np.ndarray, faces: np.ndarray, camera: Camera, reduction: int, *_: object) -> float:
    return camera.width * camera.height / reduction**2


@pytest.fixture
def meter(monkeypatch: pytest.MonkeyPatch) -> Iterator[Meter]:
    meter = Meter()

    def wrap(owner: Any, name: str, kind: str, units: Callable[..., float]) -> None:
        meter.wrap(monkeypatch, owner, name, kind, units)

    wrap(fairing.solve.energy, "evaluate_faces", "samples", kernel_samples)
    wrap(fairing.cells.sample_masks, "_mask_samples", "mask samples", lambda *a: a[15].size)
    wrap(fairing.cells.sample_masks, "depth_map", "depth px", depth_pixels)
    wrap(fairing.cells.visibility, "footprints", "faces", lambda vertices, faces, *_: len(faces))
    wrap(ScaleSpace, "_blurred", "photo px", lambda self, view, planes, *_: planes.size)
    wrap(ScaleSpace, "_decode", "photo px", lambda self, view: self._pixels_at(view, 0.0, 0.0))
    wrap(scipy.fft, "rfft2", "patch px", lambda stack: stack.size)
    wrap(fairing.geometry.closest_point, "_search", "points", lambda points, *_: len(points))
    wrap(PointRays, "assign", "rays", lambda self, mesh, reach, part: len(self._point))
    wrap(fairing.optimize.iteration, "splu", "coordinates", lambda matrix: matrix.shape[0])
    threading.setprofile(meter.calls)
    yield meter
    threading.setprofile(None)


def run(meter: Meter, scene: Scene, options: FairingOptions, steps: int | None = None) -> Session:
    """A whole run, or its plan and first steps."""
    session = Session(scene, options)
    session.cancel_requested = meter.check
    sys.setprofile(meter.calls)
    try:
        meter.check()
        for _ in range(10**9 if steps is None else steps):
            if session.step() is None:
                break
    finally:
        sys.setprofile(None)
    return session


SMALL = {
    "accurate": lambda: (corner_scene(), small_options()),
    # Later sweeps of a level repeat the second.
    "paper": lambda: (corner_scene(), small_options("paper", schedule={"max_sweeps": [2]})),
    "joint": lambda: (corner_scene(), small_options(schedule={"order": "joint", "max_sweeps": [2]})),
    "smoothed": lambda: (rough_scene(), small_options(step={"smoothing": [0.1, 0.03, 0.01]})),
    "sharp": lambda: (rough_scene(), rough_options(**SHARP_AT_LAST)),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SMALL)
def test_whole_runs_check_the_flag_often(meter: Meter, name: str):
    scene, options = SMALL[name]()
    session = run(meter, scene, options)
    assert session.finished
    assert meter.total["samples"] > 0
    assert meter.longest[0] < LIMIT, meter.longest


@pytest.mark.slow
def test_plan_and_first_steps_of_a_large_demo_scene_check_the_flag_often(meter: Meter):
    session = run(meter, replace(load_demo("facade"), points_choice="given"), PRESETS["accurate"], steps=2)
    assert session.plan is not None
    assert meter.total["samples"] > RATES["samples"] * LIMIT, "more work than may lie between two checks"
    assert meter.longest[0] < LIMIT, meter.longest


def test_the_meter_notices_work_without_a_check(meter: Meter, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(meter, "check", lambda: False)
    run(meter, corner_scene(), small_options())
    alone = meter.longest[0]
    assert alone > 0.05, "a whole run without a check"


def test_lists_of_faces_are_cut_into_parts_by_work():
    """A part is what a thread computes between two checks."""
    evaluator = fairing.solve.energy.Evaluator(threads=1)
    samples = np.full(50_000, 200_000)
    longest = max(int(samples[part].sum()) for part in evaluator._parts(samples))
    assert longest <= 1.05 * fairing.solve.energy.MAX_PART_SAMPLES
    assert longest / RATES["samples"] < LIMIT
