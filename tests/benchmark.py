"""Speed, memory and accuracy: `python -m tests.benchmark [--quick] [--json FILE] [--only PART ...]`.

`--tables` prints the tables of accuracy anew (`tests/accuracy_tables.py`).
`--family 12 [--odd]` measures the default engine on seeds of the family `building:SEED` instead (`tests/family.py`), and
`--ablate` what each of its options and constants contributes (`tests/ablation.py`).

Times are the least of several repetitions: what the machine can do when nothing else runs on it. Each whole run has a
process of its own, so that its peak memory is its own.
"""

import json
import platform
import resource
import sys
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from itertools import pairwise
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

import cv2
import numpy as np
import tyro
from skimage import data as photographs

from app.files.scene_source import SceneSource
from demo_scenes import DEMOS, load_demo
from fairing import paper
from fairing.check.memory import memory_needed
from fairing.experiments.noise import noisy_views
from fairing.io import load_scene
from fairing.judge.cramer_rao import cramer_rao_bound, luma_noise
from fairing.judge.metrics import quality_report, surface_distance
from fairing.judge.report import run_report
from fairing.kernels.data import KernelData
from fairing.options import PRESETS, FairingOptions
from fairing.run.session import Session
from fairing.scene import Scene
from fairing.solve.energy import Evaluator
from tests import ablation
from tests.accuracy_tables import GROUPS, print_tables
from tests.best_mesh import best_mesh
from tests.family import default_results, family_seeds, measure_family
from tests.large_capture import write_terrain

Table = dict[str, Any]
ACCURATE = PRESETS["accurate"]
ROUNDS = 5  # of works that are compared
CORNER_ONLY = (1, 2, 3, 4, 5, 6)


def least_seconds(work: Callable[[], object], repetitions: int) -> float:
    """The shortest of some repetitions, after one that does not count."""
    work()
    times = []
    for _ in range(repetitions):
        began = time.perf_counter()
        work()
        times.append(time.perf_counter() - began)
    return min(times)


def least_seconds_of_each(works: list[Callable[[], object]], repetitions: int) -> list[float]:
    """The same of several works, by turns, so that what else the machine does slows them alike."""
    return np.min([[least_seconds(work, repetitions) for work in works] for _ in range(ROUNDS)], axis=0).tolist()


def one_level(options: FairingOptions, blur: float, size: int) -> FairingOptions:
    """A single level with cells of exactly one size and no search."""
    schedule = replace(options.schedule, first_level="first")
    options = replace(options, cells=replace(options.cells, adaptive=False), schedule=schedule)
    return options.with_levels(blur=blur, size=size)


def kernel(quick: bool) -> Table:
    """The fused kernel against bare cv2.remap, and the paper's step in NumPy: 6 faces, one moving corner each, one thread."""
    scene, table, repetitions = load_demo("cube"), {}, 2 if quick else 8
    for preset, size in (("accurate", 64), ("accurate", 128), ("paper", paper.CELL_SIZE)):
        options = one_level(PRESETS[preset], 1.2, size)
        session = Session(scene, options)
        sweep, vertices = session.sweep_state(), session.vertices
        data, evaluator = sweep.context.kernel, Evaluator(1)

        def fused(context=sweep.context, scale=sweep.scale, vertices=vertices, evaluator=evaluator, options=options):
            corners = np.zeros(6, np.int64)
            return evaluator.linearise(context, vertices, np.arange(6), corners, scale, options.step.solver)

        masked = least_seconds(fused, ROUNDS * repetitions)
        data.pair_mask[:] = -1
        read = _read_samples(data, scene, vertices)

        def bare(read=read):
            return [cv2.remap(photo, x, y, cv2.INTER_LINEAR) for photo, x, y in read]

        works: list[Callable[[], object]] = [fused, bare]
        if preset == "paper":  # its cells are large enough for all faces to read a view's photo with the same blur
            photos = {int(view): photo for view, (photo, _, _) in zip(data.pair_view, read, strict=True)}
            by_the_paper = paper.begin_sweep(scene, [photos[v] for v in sorted(photos)], vertices, 1.2)
            by_the_paper = by_the_paper._replace(sigma=sweep.sigma)
            works.append(lambda sweep=by_the_paper, vertices=vertices: paper.fairing_step(sweep, vertices, 0))
        cv2.setNumThreads(1)
        seconds, bare_seconds, *numpy_seconds = least_seconds_of_each(works, repetitions)
        cv2.setNumThreads(-1)
        row = table[f"{preset}, {size}x{size}"] = {
            "ms": 1e3 * seconds,
            "with masks ms": 1e3 * masked,
            "of bare remap": bare_seconds / seconds,
            "M samples/s": sum(x.size for _, x, _ in read) / seconds / 1e6,
        }
        if preset == "paper":
            system, expected = fused(), works[2]()
            step = paper.solve(system.H[:, :3, :3].sum(axis=0), system.g[:, :3].sum(axis=0))
            off = float(np.linalg.norm(step - expected) / np.linalg.norm(expected))
            assert off < 0.02, f"the kernel's step and the paper's differ by {100 * off:.2f} %"
            row |= {
                "in NumPy ms": 1e3 * numpy_seconds[0],
                "speed-up": numpy_seconds[0] / seconds,
                "differs by %": 100 * off,
            }
    return table


def steps(quick: bool) -> Table:
    """Engine time of a Gauss-Newton iteration of one vertex, with cells of 64, and of a sweep's preparation."""
    options = replace(one_level(ACCURATE, 1.2, 64), locked_vertices=CORNER_ONLY)
    options = replace(options, schedule=replace(options.schedule, order="sequential"))
    options = options.with_levels(max_iterations=12, smoothing=0.0)  # the first step is one of the photos
    iterations, vertices, preparations = [], [], []
    for _ in range(2 if quick else 5):
        session = Session(load_demo("cube"), options)
        began = time.perf_counter()
        session.sweep_state()
        preparations.append(time.perf_counter() - began)
        began = time.perf_counter()
        record = session.step()
        while record is not None and record.next_position[:2] == (0, 0):
            at = time.perf_counter()
            record = session.step()
            iterations.append(time.perf_counter() - at)
        vertices.append(time.perf_counter() - began)
    return {
        "one vertex, 6 faces, 12 photos, 64x64": {
            "ms an iteration": 1e3 * float(np.median(iterations)),
            "ms a vertex (all iterations of a sweep)": 1e3 * min(vertices),
            "ms to prepare a sweep": 1e3 * min(preparations),
        }
    }


def threads(quick: bool) -> Table:
    """One thread and two on the facade: normal equations of all faces, visibility, and a whole run."""
    scene, table = load_demo("facade"), {}
    options = one_level(ACCURATE, 1.2, 64)
    for count in (1, 2):
        session = Session(scene, replace(options, threads=count))
        sweep = session.sweep_state()
        everything = np.arange(len(scene.mesh.faces))
        evaluator = Evaluator(count)

        def equations(sweep=sweep, evaluator=evaluator, vertices=session.vertices, all_faces=everything):
            corners = np.full(len(all_faces), -1)
            evaluator.linearise(sweep.context, vertices, all_faces, corners, sweep.scale, "variable_projection")

        row = {"normal equations ms": 1e3 * least_seconds(equations, 3 if quick else 10)}
        if not quick:
            row["whole run s"] = _in_own_process(_whole_run, "facade", replace(ACCURATE, threads=count))["seconds"]
        table[f"{count} threads"] = row
    one, two = table["1 threads"], table["2 threads"]
    table["gain"] = {name: one[name] / two[name] for name in one}
    return table


def demos(quick: bool) -> Table:
    """Whole runs with each preset: seconds, peak memory, errors to the truth (% of the diagonal)."""
    table = {}
    for name in ("cube",) if quick else DEMOS:
        for preset in ("accurate",) if quick else ("accurate", "paper"):
            table[f"{name}, {preset}"] = _in_own_process(_whole_run, name, PRESETS[preset])
    return table


def surfaces(quick: bool) -> Table:
    """Mean surface distance to the truth (% of the diagonal) at the end of a run, and of the best mesh there is.

    The archway's own mesh can lie on the truth everywhere: its best is 0.
    """
    return {name: _in_own_process(_surface_run, name) for name in (("dome",) if quick else ("dome", "archway"))}


def growth(quick: bool) -> Table:
    """One sweep of one step at blur 1.2 on terrains: CPU seconds, and peak memory beside what `fair` says it needs."""
    table = {}
    for n_vertices, n_photos, width in ((1_000, 10, 1500), (5_000, 10, 1500)) if quick else GROWTH:
        with TemporaryDirectory() as folder:
            write_terrain(Path(folder) / "terrain", n_vertices, n_photos, (width, width * 2 // 3))
            name = f"{n_vertices} vertices, {n_photos} photos of {width}x{width * 2 // 3}"
            table[name] = _in_own_process(_one_sweep, Path(folder) / "terrain")
    return table


# Vertices, photos, and the width of these, px: each of the three grows alone.
GROWTH = (
    *((n, 50, 1500) for n in (1_000, 5_000, 20_000, 100_000)),
    *((20_000, n, 1500) for n in (10, 200)),
    *((20_000, 50, width) for width in (750, 3000)),
)


def cube_accuracy(quick: bool) -> Table:
    """Corner A from random directions: error at the end, % of the edge; the other vertices held, then free."""
    table = {}
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(3 if quick else 20, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    cases = [(percent, True) for percent in ((5, 20) if quick else (1, 5, 10, 20, 30))] + [(10, False)]
    for percent, held in cases:
        ends, seconds, taken = [], [], []
        for direction in directions:
            session, spent = _cube_run(load_demo("cube", displacement=percent / 100 * direction), held)
            ends.append(_corner_error(session))
            seconds.append(spent)
            taken.append(len(session.trace))
        name = f"from {percent} %" + ("" if held else ", all vertices free")
        table[name] = _error_row(ends) | {"steps": float(np.median(taken)), "s": float(np.median(seconds))}
    return table


def cube_paper(quick: bool) -> Table:
    """The same with the paper's preset, fewer directions."""
    table = {}
    directions = np.random.default_rng(0).normal(size=(1 if quick else 5, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    for percent in (20,) if quick else (1, 5, 20):
        ends, taken = [], []
        for direction in directions:
            scene = load_demo("cube", displacement=percent / 100 * direction)
            session = Session(scene, replace(PRESETS["paper"], locked_vertices=CORNER_ONLY))
            session.run()
            ends.append(_corner_error(session))
            taken.append(len(session.trace))
        table[f"from {percent} %"] = _error_row(ends) | {"steps": float(np.median(taken))}
    return table


def cube_noise(quick: bool) -> Table:
    """Noise of 2 grey levels a channel: rms error of corner A against the Cramer-Rao bound with unknown texture."""
    clean = load_demo("cube", displacement=np.array([0.03, -0.02, 0.03]))
    ends = []
    for draw in range(3 if quick else 30):
        session, _ = _cube_run(replace(clean, views=noisy_views(clean.views, 2.0, draw)), held=True)
        ends.append(session.vertices[0] - 1.0)
    error = 100 * np.array(ends)
    rms, spread = np.sqrt((error**2).sum(1).mean()), np.sqrt(error.var(axis=0).sum())
    least = 100 * cramer_rao_bound(clean, 0, luma_noise(2.0))
    return {
        f"{len(ends)} draws": {
            "rms %": rms,
            "spread alone %": spread,
            "bound %": least,
            "rms / bound": rms / least,
            "spread / bound": spread / least,
        }
    }


def cube_photographs(quick: bool) -> Table:
    """Photographs as texture (scikit-image's)."""
    textures = [photographs.astronaut(), photographs.coffee(), photographs.camera()]
    directions = np.random.default_rng(1).normal(size=(1 if quick else 8, 3))
    ends = []
    for direction in directions / np.linalg.norm(directions, axis=1, keepdims=True):
        session, _ = _cube_run(load_demo("cube", displacement=0.1 * direction, textures=textures), held=True)
        ends.append(_corner_error(session))
    return {"from 10 %": _error_row(ends)}


PARTS: dict[str, Callable[[bool], Table]] = {
    part.__name__: part
    for part in (
        kernel,
        steps,
        threads,
        demos,
        surfaces,
        growth,
        cube_accuracy,
        cube_paper,
        cube_noise,
        cube_photographs,
    )
}


def _cube_run(scene: Scene, held: bool) -> tuple[Session, float]:
    began = time.perf_counter()
    session = Session(scene, replace(ACCURATE, locked_vertices=CORNER_ONLY if held else ()))
    session.run()
    return session, time.perf_counter() - began


def _corner_error(session: Session) -> float:
    """% of the edge."""
    return 100 * float(np.linalg.norm(session.vertices[0] - 1.0))


def _error_row(ends: list[float]) -> dict[str, float]:
    errors = np.array(ends)
    return {
        "rms %": float(np.sqrt((errors**2).mean())),
        "median %": float(np.median(errors)),
        "max %": float(errors.max()),
        "within 0.005 %": float((errors <= 0.005).mean()),
    }


def _in_own_process(work: Callable[..., Table], *arguments: object) -> Table:
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        row = pool.submit(work, *arguments).result()
    print(f"{arguments[0]}: {row}", file=sys.stderr, flush=True)  # some parts take an hour
    return row


def _read_samples(
    data: KernelData, scene: Scene, vertices: np.ndarray
) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """What the pairs of face and view read: a photo and the coordinates x, y (1, p) of the samples, for `cv2.remap`."""
    found = []
    for face, (first, last) in enumerate(pairwise(data.pair_start)):
        grid = data.face_grid[face]
        a, b = data.ramp[:, data.grid_start[grid] : data.grid_start[grid + 1]]
        for pair in range(first, last):
            base, (_, _, width, height) = data.pair_base[pair], data.pair_frame[pair]
            corners = scene.views[data.pair_view[pair]].camera.project(vertices[data.faces[face]])[0]
            x, y = np.float32(corners.T @ np.stack([a, b, 1 - a - b]))
            found.append((data.pixels[base : base + width * height].reshape(height, width), x[None], y[None]))
    return found


def _whole_run(name: str, options: FairingOptions) -> Table:
    scene = SceneSource.typed(name, None, points="automatic").load()
    began = time.perf_counter()
    session = Session(scene, options)
    session.run()
    row: Table = {"seconds": time.perf_counter() - began, "steps": len(session.trace), "peak MB": _peak_megabytes()}
    quality = quality_report(scene, scene.mesh.vertices, session.vertices)
    for label, key in (("determined", "vertices_determined"), ("surface", "surface_to_truth")):
        before, after = quality[key]["before"], quality[key]["after"]
        row[f"{label} rms"] = f"{before['rms_percent']:.3f}>{after['rms_percent']:.4f}"
        row[f"{label} median"] = f"{before['median_percent']:.3f}>{after['median_percent']:.4f}"
    row["most worsened"] = quality["vertices_determined"]["most_worsened_percent"]
    row["flips"] = len(quality["flipped_faces"])
    return row


def _surface_run(name: str) -> Table:
    scene = load_demo(name)
    assert scene.truth is not None
    assert scene.truth.vertices is not None
    assert scene.truth.normals is not None
    session = Session(scene, ACCURATE)
    session.run()
    best = best_mesh(scene.mesh.moved(scene.truth.vertices), scene.truth.normals, scene.truth.surface)
    ends = {"end": scene.mesh.moved(session.vertices), "best": best}
    row: Table = {
        label: float(surface_distance(mesh, scene.truth.surface, scene.mesh.diagonal).percent.mean())
        for label, mesh in ends.items()
    }
    return row | {"ratio": row["end"] / row["best"] if row["best"] > 1e-9 else float("nan")}


def _one_sweep(folder: Path) -> Table:
    options = replace(ACCURATE, schedule=replace(ACCURATE.schedule, first_level="first"))
    options = options.with_levels(blur=1.2, max_sweeps=1, max_iterations=1, smoothing=0.0)
    began = time.process_time()
    scene = load_scene(folder)
    needed, loaded = memory_needed(scene, options), time.process_time()
    session = Session(scene, options)
    sweep, prepared = session.sweep_state(), time.process_time()
    session.run()
    stepped = time.process_time()
    run_report(session, "accurate", {}, quality_report(scene, session.trace.start, session.vertices))
    ended = time.process_time()
    return {
        "faces": len(scene.mesh.faces),
        "cells": len(sweep.context.kernel.pair_view),
        "M samples": session.samples / 1e6,
        "load": loaded - began,
        "prepare": prepared - loaded,
        "step": stepped - prepared,
        "report": ended - stepped,
        "ns a sample": 1e9 * (ended - began) / session.samples,
        "peak MB": _peak_megabytes(),
        "told MB": needed / 1e6,
    }


def _peak_megabytes() -> float:
    """Of this process; Linux counts its parent's peak in ru_maxrss, too, so its own file is asked first."""
    status = Path("/proc/self/status")
    for line in status.read_text().splitlines() if status.exists() else ():
        if line.startswith("VmHWM:"):
            return float(line.split()[1]) / 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def _print(title: str, table: Table) -> None:
    print(f"\n{title}: {PARTS[title].__doc__}")
    columns = list(dict.fromkeys(column for row in table.values() for column in row))
    cells = [[_text(row.get(column, "")) for column in columns] for row in table.values()]
    first = max(map(len, table))
    widths = [max(len(column), *(len(row[c]) for row in cells)) for c, column in enumerate(columns)]
    print(" " * first, *(column.rjust(width) for column, width in zip(columns, widths, strict=True)), sep="  ")
    for name, row in zip(table, cells, strict=True):
        print(name.ljust(first), *(text.rjust(width) for text, width in zip(row, widths, strict=True)), sep="  ")


def _text(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


@dataclass(frozen=True)
class Arguments:
    """Measure speed, memory and accuracy."""

    quick: bool = False
    """Fewer repetitions and cases: about a minute."""
    json: Path | None = None
    """Write the figures to this file, too (of family and ablation: default in the cache folder; the table goes beside it)."""
    only: Annotated[
        tuple[str, ...], tyro.conf.arg(help=f"Some of: {', '.join(PARTS)}; with --tables of: {', '.join(GROUPS)}.")
    ] = ()
    tables: bool = False
    """Print the tables of accuracy anew instead: an hour, a third of it for the buildings."""
    buildings: int = 0
    """With --tables: only so many of the generated buildings."""
    family: int = 0
    """Measure so many seeds of the family instead: 0, 2, 4, ... Runs of the same code in the results file are not repeated."""
    odd: bool = False
    """The odd seeds of the family: 1, 3, 5, ..."""
    seeds: tuple[int, ...] = ()
    """These seeds of the family."""
    ablate: bool = False
    """Run every option and constant turned off, halved and doubled instead: hours. Runs in the results file are not repeated."""
    settings: tuple[str, ...] = ()
    """With --ablate: these options (step.max_step) and constants (fairing.run.sweep.FIT_ROUNDS) alone."""
    scenes: tuple[str, ...] = ablation.SCENES
    """With --ablate: demos, or mesh files in folders of captures that hold a `reference_mesh.ply`."""


def main() -> None:
    """Run the parts asked for and print a table of each."""
    arguments = tyro.cli(Arguments)
    if arguments.tables:
        print_tables(arguments.only, arguments.buildings)
        return
    if seeds := arguments.seeds or family_seeds(arguments.family, arguments.odd):
        measure_family(seeds, arguments.json or default_results())
        return
    if arguments.ablate:
        ablation.measure_ablation(arguments.scenes, arguments.settings, arguments.json or ablation.default_results())
        return
    results: Table = {
        "machine": {"processor": platform.processor() or platform.machine(), "python": platform.python_version()}
    }
    for name in arguments.only or PARTS:
        results[name] = PARTS[name](arguments.quick)
        _print(name, results[name])
        if arguments.json is not None:
            arguments.json.write_text(json.dumps(results, indent=1, default=float) + "\n")


if __name__ == "__main__":
    main()
