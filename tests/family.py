"""Accuracy and cost of the default engine on the family `building:SEED`: `python -m tests.benchmark --family 12 [--odd]`.

Each seed is faired twice, from its own start mesh and from the truth, each run in a process of its own. The results file
grows with every run; a run that is in it, made by the same code, is not repeated. Even seeds are for tuning, odd seeds
judge.
"""

import json
import sys
import time
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

import demo_scenes
import fairing
from app.files.scene_source import SceneSource
from demo_scenes.building.plan import draw_plan
from demo_scenes.cache import cache_folder, source_digest
from fairing.errors import InputError
from fairing.geometry.closest_point import SurfaceTree
from fairing.judge.metrics import surface_distance, vertex_errors
from fairing.options import PRESETS, FairingOptions
from fairing.run.session import Session
from fairing.scene import Scene

Row = dict[str, Any]
BEGINNINGS = ("start", "truth")
SAME = 1e-4  # % of the diagonal: larger increases of an error count as worse
NEAR_TRUTH = 1.5  # a run that ends within this factor of the surface error of the run from the truth has found its way


def family_seeds(count: int, odd: bool) -> list[int]:
    """The first seeds that are even, or odd."""
    return [2 * k + int(odd) for k in range(count)]


def default_results() -> Path:
    """The results file in the cache folder."""
    return cache_folder() / "family.json"


def measure_family(seeds: Sequence[int], results: Path) -> list[Row]:
    """Measure seeds that the results file lacks; print and write the table after each of them.

    Args:
        results: JSON file; the table goes beside it with the suffix .md.
    """
    code = code_digest()
    known: dict[str, Row] = json.loads(results.read_text()) if results.exists() else {}
    for seed in seeds:
        row = known.get(str(seed), {})
        if row.get("code") != code:
            row = {"seed": seed, "code": code, **scene_facts(seed)}
        for beginning in BEGINNINGS:
            if beginning not in row:
                with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
                    row[beginning] = pool.submit(run_from, seed, beginning).result()
                known[str(seed)] = row
                results.parent.mkdir(parents=True, exist_ok=True)
                results.write_text(json.dumps(known, indent=1) + "\n")
                results.with_suffix(".md").write_text(
                    family_table(row for row in known.values() if row["code"] == code and "truth" in row)
                )
                print(f"building:{seed} from the {beginning}: {row[beginning]}", file=sys.stderr, flush=True)
    rows = [known[str(seed)] for seed in seeds]
    print(family_table(rows))
    print(f"written to {results} and {results.with_suffix('.md')}")
    return rows


def scene_facts(seed: int) -> Row:
    """What the plan of a seed says, without photos."""
    plan = draw_plan(seed)
    width, height = plan.shoot.size
    return {
        "kind": plan.start,
        "start px": round(plan.start_px, 1),
        "photos": plan.shoot.photos,
        "Mpx": round(width * height / 1e6, 2),
        "points": plan.has_points,
    }


def run_from(seed: int, beginning: str) -> Row:
    """A whole run as `eigenfairing fair building:SEED` makes it: errors in % of the diagonal, samples, processor seconds.

    Args:
        beginning: "start" or "truth".
    """
    return run_scene(SceneSource.typed(f"building:{seed}", None, points="automatic").load(), beginning)


def run_scene(scene: Scene, beginning: str, options: FairingOptions = PRESETS["accurate"]) -> Row:
    """The same for a loaded scene, with other options."""
    begun = scene if beginning == "start" else at_truth(scene)
    began, session = time.process_time(), Session(begun, options)
    try:
        session.run()
    except InputError as error:
        return {"faces": len(scene.mesh.faces), "failed": str(error)}
    return {
        "faces": len(scene.mesh.faces),
        "before": errors_of(scene, begun.mesh.vertices),
        "after": errors_of(scene, session.vertices),
        "samples": session.samples,
        "seconds": time.process_time() - began,
    }


def at_truth(scene: Scene) -> Scene:
    """The scene with its vertices at their true places, or at the nearest points of the true surface."""
    assert scene.truth is not None
    if scene.truth.vertices is not None:
        return replace(scene, mesh=scene.mesh.moved(scene.truth.vertices))
    surface, vertices = scene.truth.surface, scene.mesh.vertices
    face = SurfaceTree(surface).closest(vertices)[1]
    nearest = trimesh.triangles.closest_point(surface.vertices[surface.faces[face]], vertices)
    return replace(scene, mesh=scene.mesh.moved(nearest))


def errors_of(scene: Scene, vertices: np.ndarray) -> Row:
    """Distances of vertices (n, 3) and of their faces to the truth, % of the diagonal of the scene's start mesh."""
    assert scene.truth is not None
    surface = surface_distance(scene.mesh.moved(vertices), scene.truth.surface, scene.mesh.diagonal).summary()
    found = {"surface median": surface["median_percent"], "surface rms": surface["rms_percent"]}
    if scene.truth.vertices is not None:
        determined = vertex_errors(scene, vertices).determined.summary()
        found |= {"median": determined["median_percent"], "rms": determined["rms_percent"]}
        found |= {"worst": determined["max_percent"]}
    return found


def is_worse(row: Row) -> bool:
    """Whether a run from the start ended with a larger rms error than it began with, of vertices or of the surface."""
    run = row["start"]
    if "failed" in run:
        return False
    return any(run["after"][key] > run["before"][key] + SAME for key in ("rms", "surface rms") if key in run["after"])


def family_table(rows: Iterable[Row]) -> str:
    """The results as a Markdown table, a row for each seed, then medians over the seeds."""
    rows = sorted(rows, key=lambda row: row["seed"])
    head = (
        "| seed | start | faces | photos | Mpx | points | determined median | rms | worst vertex | surface median | "
        "surface rms | worse | G samples | processor s | from the truth: s |"
    )
    lines = [
        "Errors in % of the diagonal: start > end (end of the run from the truth).",
        "",
        head,
        "|" + "---|" * (head.count("|") - 1),
    ]
    for row in rows:
        run, truth = row["start"], row["truth"]
        facts = (
            f"| {row['seed']} | {row['kind']} {row['start px']} px | {run['faces']} | {row['photos']} | {row['Mpx']} "
        )
        facts += f"| {'given' if row['points'] else '-'} "
        if "failed" in run or "failed" in truth:
            lines.append(facts + f"| failed: {run.get('failed', truth.get('failed'))} " + "|" * 9)
            continue
        cells = [_change(run, truth, key) for key in ("median", "rms", "worst", "surface median", "surface rms")]
        cost = f"{run['samples'] / 1e9:.2f} | {run['seconds']:.0f} | {truth['seconds']:.0f} |"
        lines.append(f"{facts}| {' | '.join(cells)} | {'WORSE' if is_worse(row) else '-'} | {cost}")
    return "\n".join([*lines, "", *_summary(rows)]) + "\n"


def _change(run: Row, truth: Row, key: str) -> str:
    if key not in run["after"]:
        return "-"
    return f"{run['before'][key]:.3f} > {run['after'][key]:.3f} ({truth['after'][key]:.3f})"


def _summary(rows: list[Row]) -> list[str]:
    done = [row for row in rows if "failed" not in row["start"] and "failed" not in row["truth"]]
    if not done:
        return []
    lines = []
    for key in ("median", "rms", "surface median", "surface rms"):
        ends = [row["start"]["after"][key] for row in done if key in row["start"]["after"]]
        if ends:
            label = key if key.startswith("surface") else f"determined {key}"
            lines.append(
                f"- {label} at the end: median {np.median(ends):.3f}, largest {max(ends):.3f} ({len(ends)} seeds)"
            )
    surface = [
        row["start"]["after"]["surface rms"] <= NEAR_TRUTH * row["truth"]["after"]["surface rms"] for row in done
    ]
    lines.append(f"- surface rms within {NEAR_TRUTH:g} x of the run from the truth: {sum(surface)} of {len(done)}")
    lines.append(f"- ended worse than they began: {sum(map(is_worse, done))} of {len(done)}")
    seconds, samples = (sum(row["start"][key] for row in done) for key in ("seconds", "samples"))
    lines.append(f"- {samples / 1e9:.1f} G samples and {seconds:.0f} s of processor time for all of them")
    return lines


def code_digest() -> str:
    """Of the engine and the demo scenes, so that results of other code are measured again."""
    return source_digest(
        module for package in (fairing, demo_scenes) for module in sorted(Path(package.__path__[0]).rglob("*.py"))
    )
