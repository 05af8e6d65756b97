"""The tables of accuracy, measured anew on one machine: `python -m tests.benchmark --tables [--only GROUP ...]`.

All of them are in `app/guides/accuracy.md`; the README repeats two columns of the table of group
`noisy`, and a line of `buildings`.

Runs are made by the commands, as a reader makes them, each in a process of its own. Every group prints the
tables of its part of that file as Markdown. Groups on photographs need `../shared/captures`, see its README.md; the cache
keeps found points and rendered photos between calls.

Processor time is that of a whole command, with one that was run before, so that nothing is compiled. It is stated as a
multiple of a reference run right after it, so that it can be compared between machines; see `reference_seconds`.
"""

import json
import resource
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import cv2
import numpy as np

from app.files.run_files import MESH, REPORT, TRACE
from demo_scenes import load_demo
from demo_scenes.building.plan import draw_plan
from fairing.experiments import EXPERIMENTS
from fairing.geometry.closest_point import SurfaceTree
from fairing.io import read_mesh
from fairing.judge.metrics import surface_distance
from fairing.mesh import Mesh
from fairing.options import PRESETS
from fairing.run.session import Session
from fairing.trace import Trace
from fairing.util.cache_folder import cache_folder
from tests.processors import PROCESSORS, ROOT, run_each

CAPTURES = ROOT.parent / "shared" / "captures"
STARTS = (1, 5, 20)  # % of the cube's edge
DIRECTIONS = 5
SURVEYED = ("fountain-P11", "castle-P19", "SceauxCastle")
REFINEMESH = {  # mean / median that remain of the start's distance, %: default, and best hand-tuned setting (OpenMVS 2.3)
    "fountain-P11": ("71 / 63 %", "46 / 39 %"),
    "castle-P19": ("108 / 103 % (worse)", "83 / 73 %"),
}
FAR_SEEDS = range(232, 799, 2)
"""Seeds of buildings that nothing was tuned on."""
FAR_STARTS = ("corners", "noise")
COMPARED = ("cube", "facade", "building:14", "building:20", "building:50")  # between processors
REMAPPED = 100  # Mpx of the reference run


@dataclass(frozen=True)
class Run:
    """A run of `fair` in its folder.

    Attributes:
        seconds: processor seconds of the command.
        reference: processor seconds of the reference right after it.
    """

    folder: Path
    seconds: float
    reference: float

    @property
    def report(self) -> dict[str, Any]:
        return json.loads((self.folder / REPORT).read_text())

    @property
    def cost(self) -> str:
        return f"{self.seconds / self.reference:.0f}"


def reference_seconds() -> float:
    """Processor seconds of a bilinear `cv2.remap` of `REMAPPED` million floats in one thread, the least of three."""
    photo = np.random.default_rng(0).uniform(0, 255, (1000, 1000)).astype(np.float32)
    y, x = np.mgrid[:1000, :1000].astype(np.float32) * np.float32(0.9) + np.float32(20.3)
    times, threads = [], cv2.getNumThreads()
    cv2.setNumThreads(1)
    for _ in range(3):
        began = time.process_time()
        for _ in range(REMAPPED):
            cv2.remap(photo, x, y, cv2.INTER_LINEAR)
        times.append(time.process_time() - began)
    cv2.setNumThreads(threads)
    return min(times)


def command(*arguments: object) -> float:
    """Run a command of the program; its processor seconds."""
    words = [str(word) for word in arguments]
    print("eigenfairing", *words, file=sys.stderr, flush=True)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([sys.executable, "-m", "app", *words], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def fair(out: Path, scene: object, *flags: object) -> Run:
    """Run `fair` into a folder."""
    return Run(out, command("fair", scene, "--out", out, *flags), reference_seconds())


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table in Markdown."""
    return "\n".join(f"| {' | '.join(row)} |" for row in (head, ["---"] * len(head), *rows))


def cube(folder: Path, most_buildings: int) -> Iterator[str]:
    """Corner A from some directions, the other vertices locked: median error at the end, median number of steps."""
    directions = np.random.default_rng(0).normal(size=(DIRECTIONS, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    rows = []
    for percent in STARTS:
        row = [f"{percent} %"]
        for preset in ("paper", "accurate"):
            options, ends, steps = replace(PRESETS[preset], locked_vertices=(1, 2, 3, 4, 5, 6)), [], []
            for direction in directions:
                session = Session(load_demo("cube", displacement=percent / 100 * direction), options)
                session.run()
                ends.append(100 * float(np.linalg.norm(session.vertices[0] - 1)))
                steps.append(len(session.trace))
            row += [f"{np.median(ends):.2g} % (at most {max(ends):.2g} %)", f"{np.median(steps):.0f}"]
        rows.append(row)
    yield table(["start", "preset `paper` ends at", "steps", "preset `accurate` ends at", "steps"], rows)


def experiments(folder: Path, most_buildings: int) -> Iterator[str]:
    """The findings of the experiments on the cube."""
    for name in EXPERIMENTS:
        command("experiment", name, "cube", "--out", folder / name)
        (record,) = (folder / name).glob("*.json")
        yield f"- `{name}`: {json.loads(record.read_text())['finding']}"


def noisy(folder: Path, most_buildings: int) -> Iterator[str]:
    """The noisy meshes of 600 vertices: what remains of the distance to the reference, beside RefineMesh."""
    rows, ends = [], []
    for name in REFINEMESH:
        capture = CAPTURES / name
        start = capture / "coarse_600_noisy.ply"
        reference = SurfaceTree(Mesh(*read_mesh(capture / "reference_mesh.ply")))
        diagonal = Mesh(*read_mesh(start)).diagonal

        def distance(mesh: Path, reference: SurfaceTree = reference, diagonal: float = diagonal) -> np.ndarray:
            found = surface_distance(Mesh(*read_mesh(mesh)), reference, diagonal).percent
            return np.array([found.mean(), np.median(found)])

        before, row = distance(start), [name, *REFINEMESH[name]]
        given = ("--cameras", "given")  # as RefineMesh and the reference
        for label, flags in (("none", (*given, "--points", "none")), ("corrected", ()), ("given", given)):
            run = fair(folder / f"{name}-{label}", capture, "--mesh", start, *flags)
            after = distance(run.folder / MESH)
            remain = 100 * after / before
            row.append(f"{remain[0]:.0f} / {remain[1]:.0f} %")
        rows.append(row)
        ends.append(
            f"{name} from {before[0]:.3f} / {before[1]:.3f} to {after[0]:.3f} / {after[1]:.3f}, in as much processor time as "
            f"{run.cost} runs of the reference"
        )
    head = ["capture", "RefineMesh, default settings", "RefineMesh, best hand-tuned setting"]
    yield table([*head, "`accurate` without sparse points", "with corrected cameras", "`accurate`"], rows)
    yield f"In percent of the diagonal: {'; '.join(ends)}."


def buildings(folder: Path, most_buildings: int) -> Iterator[str]:
    """Generated buildings that nothing was tuned on."""
    found = []
    for seed in islice(far_seeds(), most_buildings or None):
        quality = fair(folder / str(seed), f"building:{seed}").report["quality"]["vertices_determined"]
        found.append([[quality[state][f"{key}_percent"] for key in ("median", "rms")] for state in ("before", "after")])
        shutil.rmtree(folder / str(seed))
    (start_median, start_rms), (median, rms) = np.transpose(found, (1, 2, 0))
    rows = [
        ["median vertex, median over the scenes", f"{np.median(start_median):.3f}", f"{np.median(median):.3f}"],
        ["rms of all vertices, median over the scenes", f"{np.median(start_rms):.3f}", f"{np.median(rms):.3f}"],
        ["rms of all vertices, the worst scene", f"{start_rms.max():.3f}", f"{rms.max():.3f}"],
    ]
    yield f"{len(found)} scenes; {(rms > start_rms).sum()} ended with a larger rms than they began with."
    yield table(["", "start", "`accurate`"], rows)


def far_seeds() -> Iterator[int]:
    """The seeds of `FAR_SEEDS` whose start is one of `FAR_STARTS`, 5 to 15 px off; a plan takes a second to draw."""
    for seed in FAR_SEEDS:
        plan = draw_plan(seed)
        if plan.start in FAR_STARTS and 5 <= plan.start_px <= 15:
            yield seed


def left_out(folder: Path, most_buildings: int) -> Iterator[str]:
    """Left-out photos and held-out points, from meshes that structure from motion or a dense reconstruction gave."""
    starts = [(name, "init_sfm.ply", "structure from motion") for name in SURVEYED]
    starts.append(("fountain-P11", "coarse_2500.ply", "a dense reconstruction"))
    predicted, held_out = [], []
    for name, mesh, origin in starts:
        capture, out = CAPTURES / name, folder / f"{name}-{mesh}"
        run = fair(out, capture, "--mesh", capture / mesh, "--left-out")
        label = f"{name}, {run.report['scene']['input_vertices']:,} vertices from {origin}"
        predicted.append([label, *_predictions(run)])
        if mesh == "init_sfm.ply":
            photos = fair(folder / f"{name}-photos", capture, "--mesh", capture / mesh, "--step.points", 0)
            (before, after), alone = _held_out(run), _held_out(photos)
            held_out.append(
                [f"{name}, from {origin}", f"{before:.3f}", f"{after:.3f} ({_change(before, after)})", _change(*alone)]
            )
    yield table(["capture and start mesh", "before", "after", "photos improved"], predicted)
    yield table(["capture and start mesh", "before", "after", "after, with `--step.points 0`"], held_out)


def triangulated(folder: Path, most_buildings: int) -> Iterator[str]:
    """Start meshes that `triangulate` makes of given points."""
    rows = []
    for name in SURVEYED:
        capture, start = CAPTURES / name, folder / f"{name}.ply"
        command("triangulate", capture, "--out", start)
        run = fair(folder / name, capture, "--mesh", start, "--left-out")
        before, after, improved = _predictions(run)
        points = "{:.3f} -> {:.3f} %".format(*_held_out(run))
        rows.append([name, points, f"{before} -> {after}", improved])
    head = ["capture", "held-out points, `triangulate`, before and after"]
    yield table([*head, "PSNR, `triangulate`, before and after `accurate`", "photos improved"], rows)


def photos_alone(folder: Path, most_buildings: int) -> Iterator[str]:
    """Meshes and points found in the photos, beside those of the capture's own points, on the pixels both cover."""
    for name in (*SURVEYED, "templeSparseRing"):
        capture, ends = CAPTURES / name, {}
        for points in ("given", "own"):
            start, out = folder / f"{name}-{points}.ply", folder / f"{name}-{points}"
            command("triangulate", capture, "--out", start, "--points", points)
            beside = ("--left-out", "--beside", ends["given"].folder / MESH) if points == "own" else ()
            ends[points] = fair(out, capture, "--mesh", start, "--points", points, *beside)
        found = ends["own"].report["left_out"]
        yield f"- {name}: {found['psnr_after']:.2f} dB, with the capture's own points {found['psnr_beside']:.2f} dB"


def processors(folder: Path, most_buildings: int) -> Iterator[str]:
    """How far runs as on other kinds of processors end from those of this machine, of the same photos."""
    rows = []
    for scene in COMPARED:
        out, ends = folder / scene.replace(":", "-"), {}
        host = fair(out / "host", scene)
        here = _vertices(host.folder)
        for name in PROCESSORS:
            shutil.copytree(
                cache_folder(), folder / name / "cache", ignore=shutil.ignore_patterns("points"), dirs_exist_ok=True
            )

        def run_there(name: str, scene: str = scene, out: Path = out) -> Sequence[str]:
            return ("-m", "app", "fair", scene, "--out", str(out / name))

        for name, done in run_each(run_there, folder).items():
            assert done.returncode == 0, done.stdout
            off = 100 * np.linalg.norm(_vertices(out / name) - here, axis=1) / host.report["scene"]["diagonal"]
            ends[name] = [f"{np.median(off):.2g} / {off.max():.2g}", _rms(replace(host, folder=out / name))]
        rows.append([scene, _rms(host), *(cell for cells in ends.values() for cell in cells)])
    yield "Distances of vertices from those of this machine, median / largest, and rms errors, % of the diagonal:"
    there = [head for name in ends for head in (f"as on {name}: distance", "error")]
    yield table(["scene", "error here", *there], rows)


GROUPS: dict[str, Callable[[Path, int], Iterator[str]]] = {
    group.__name__: group
    for group in (cube, experiments, noisy, buildings, left_out, triangulated, photos_alone, processors)
}
ON_PHOTOGRAPHS = ("noisy", "left_out", "triangulated", "photos_alone")


def print_tables(only: Sequence[str], most_buildings: int) -> None:
    """Measure groups, all if none is named, and print each when it is done.

    Args:
        most_buildings: so many buildings; 0 for all.
    """
    if unknown := set(only) - set(GROUPS):
        sys.exit(f"--only: expected some of {', '.join(GROUPS)}, found {', '.join(unknown)}")
    with TemporaryDirectory() as folder:
        fair(Path(folder) / "first", "cube")  # compiles
        for name in only or GROUPS:
            print(f"\n{name}: {GROUPS[name].__doc__}", flush=True)
            if name in ON_PHOTOGRAPHS and not CAPTURES.exists():
                print(f"skipped: no {CAPTURES}")
                continue
            (Path(folder) / name).mkdir()
            for text in GROUPS[name](Path(folder) / name, most_buildings):
                print(text, flush=True)
    print(
        f"\nProcessor time is stated in runs of the reference, which takes {reference_seconds():.2f} s on this machine now."
    )


def _predictions(run: Run) -> tuple[str, str, str]:
    """PSNR (SSIM) before and after, and how many photos improved."""
    found = run.report["left_out"]
    before, after = (
        f"{found[f'psnr_{state}']:.2f} dB ({found[f'ssim_{state}']:.3f})".replace("(0.", "(.")
        for state in ("before", "after")
    )
    return before, after, f"{found['photos_better']} of {found['photos_judged']}"


def _held_out(run: Run) -> tuple[float, float]:
    """Median distance of held-out points to the surface before and after, % of the diagonal."""
    found = run.report["quality"]["sparse_points_to_surface"]
    return found["before"]["median_percent"], found["after"]["median_percent"]


def _change(before: float, after: float) -> str:
    return f"{100 * (after / before - 1):.0f} %"


def _rms(run: Run) -> str:
    """Rms error of the vertices to the truth at the end, % of the diagonal; sliding within a true plane does not count."""
    return f"{run.report['quality']['vertices_determined']['after']['rms_percent']:.3g}"


def _vertices(folder: Path) -> np.ndarray:
    """(n, 3) float: vertices at the end of the run in a folder."""
    trace = Trace.load(folder / TRACE)
    return trace.vertices_at(len(trace))
