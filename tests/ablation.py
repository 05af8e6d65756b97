"""What each option and constant of the engine contributes: `python -m tests.benchmark --ablate [--scenes ...]`.

A variant changes one option or one constant: turned off (or to its alternative), halved, doubled. Every run has a process
of its own with one thread. The results file grows with every run; a run that is in it, made by the same code, is not
repeated.
"""

import json
import os
import sys
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from importlib import import_module
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from app.debugger.option_fields import changed_options, option_fields
from app.files.scene_source import SceneSource
from demo_scenes.cache import cache_folder
from fairing.errors import InputError
from fairing.io import read_mesh
from fairing.mesh import Mesh
from fairing.options import PRESETS
from fairing.scene import Scene, Truth
from tests.family import code_digest, run_scene

SCENES = ("building:4", "building:16", "building:24", "building:34", "building:38", "building:42")
REFERENCE = "reference_mesh.ply"  # beside a capture's mesh: what the result is compared with
FIGURES = ("median", "rms", "surface rms", "samples")
AS_COMMITTED = "as committed"
ALTERNATIVES = ("off", "halved", "doubled")


@dataclass(frozen=True)
class Setting:
    """An option such as "step.max_step", or a constant such as "fairing.run.sweep.POINTS_VARIANCE".

    Attributes:
        name: path of the option within `FairingOptions`, or of the constant.
        off: the value that turns it off, or the alternative of an option that names a method; None if there is none.
        is_scaled: whether half and twice its value are meant to work.
    """

    name: str
    off: Any = None
    is_scaled: bool = True

    @property
    def value(self) -> Any:
        """As committed."""
        if self.name.startswith("fairing."):
            module, constant = self.name.rsplit(".", 1)
            return getattr(import_module(module), constant)
        return next(field for field in option_fields() if field.name == self.name).of(PRESETS["accurate"])

    def alternatives(self) -> dict[str, Any]:
        """Values to run, by name."""
        found = {} if self.off is None else {"off": self.off}
        if self.is_scaled:
            found |= {"halved": scaled(self.value, 0.5), "doubled": scaled(self.value, 2.0)}
        return {name: value for name, value in found.items() if value != self.value}


SETTINGS = (
    Setting("cells.warp", off="affine", is_scaled=False),
    Setting("cells.adaptive", off=False, is_scaled=False),
    Setting("cells.spacing"),
    Setting("cells.inset", off=(0.0,)),
    Setting("cells.interpolation", off=("bilinear",), is_scaled=False),
    Setting("cells.point_spread", off=("as_seen",), is_scaled=False),
    Setting("cells.weighting", off="cell", is_scaled=False),
    Setting("eigenspace.dimensions"),
    Setting("robust.norm", off="least_squares", is_scaled=False),
    Setting("robust.sigma_rule", off=("paper",), is_scaled=False),
    Setting("robust.sigma"),
    Setting("robust.mad_factor"),
    Setting("step.solver", off="alternating", is_scaled=False),
    Setting("step.max_step"),
    Setting("step.prior", off=0.0),
    Setting("step.smoothing", off=(0.0,)),
    Setting("step.points", off=(0.0,)),
    Setting("step.creases", off=(0.0,)),
    Setting("visibility.min_angle", off=0.0),
    Setting("visibility.min_footprint", off=0.0),
    Setting("visibility.edge_margin", off=0.0),
    Setting("visibility.min_samples", off=0.0),
    Setting("visibility.reduction"),
    Setting("visibility.max_views"),
    Setting("schedule.max_sweeps"),
    Setting("schedule.max_iterations"),
    Setting("schedule.sweep_tolerance", off=0.0),
    Setting("fairing.run.stepper.GAIN", off=0.0),
    Setting("fairing.run.fits.FAR_ERROR"),
    Setting("fairing.run.sweep.POINTS_VARIANCE"),
    Setting("fairing.cells.level_choice.FOOTPRINT_PER_BLUR"),
    Setting("fairing.options.FINE_BLUR"),
    Setting("fairing.terms.points.PRIOR_SIGMA"),
    Setting("fairing.terms.axes.LEAST_PART", off=2.0),
    Setting("fairing.terms.axes.SCALE"),
)


def scaled(value: Any, factor: float) -> Any:
    """A number or the numbers of a tuple times a factor; whole numbers stay whole and at least 1, or 0 where they are 0."""
    if isinstance(value, tuple):
        return tuple(scaled(item, factor) for item in value)
    if isinstance(value, int):
        return max(1, int(value * factor)) if value else 0
    return value * factor


def measure_ablation(scenes: Sequence[str], settings: Sequence[str], results: Path) -> None:
    """Run the variants that the results file lacks; print and write the table.

    Args:
        scenes: demos, or mesh files in the folder of a capture that also holds a `reference_mesh.ply`.
        settings: names from `SETTINGS`, or none for all of them.
        results: JSON file; the table goes beside it with the suffix .md.

    Raises:
        InputError: a setting that is not known.
    """
    known_names = [setting.name for setting in SETTINGS]
    for name in settings:
        if name not in known_names:
            raise InputError(f"--settings {name}: expected some of {', '.join(known_names)}")
    chosen = [setting for setting in SETTINGS if not settings or setting.name in settings]
    code = code_digest()
    rows: dict[str, dict[str, Any]] = json.loads(results.read_text()) if results.exists() else {}
    rows = {key: row for key, row in rows.items() if row["code"] == code}
    wanted = [(scene, "", AS_COMMITTED, None) for scene in scenes]
    wanted += [
        (scene, setting.name, name, value)
        for setting in chosen
        for name, value in setting.alternatives().items()
        for scene in scenes
    ]
    with ProcessPoolExecutor(os.cpu_count(), mp_context=get_context("spawn"), max_tasks_per_child=1) as pool:
        runs = {
            pool.submit(run_variant, scene, setting, value): _key(scene, setting, alternative)
            for scene, setting, alternative, value in wanted
            if _key(scene, setting, alternative) not in rows
        }
        for run in as_completed(runs):
            rows[runs[run]] = {"code": code, **run.result()}
            results.parent.mkdir(parents=True, exist_ok=True)
            results.write_text(json.dumps(rows, indent=1) + "\n")
            print(f"{runs[run]}: {rows[runs[run]]}", file=sys.stderr, flush=True)
    table = ablation_table(chosen, scenes, rows)
    results.with_suffix(".md").write_text(table)
    print(table)
    print(f"written to {results} and {results.with_suffix('.md')}")


def default_results() -> Path:
    """The results file in the cache folder."""
    return cache_folder() / "ablation.json"


def run_variant(scene: str, setting: str, value: Any) -> dict[str, Any]:
    """A whole run with one changed option or constant: errors in % of the diagonal and cell samples, or why it failed."""
    options = replace(PRESETS["accurate"], threads=1)
    if setting.startswith("fairing."):
        set_constant(setting, value)
    elif setting:
        options = changed_options(options, {tuple(setting.split(".")): value})
    run = run_scene(scene_with_truth(scene), "start", options)
    if "failed" in run:
        return run
    kind = "" if "median" in run["after"] else "surface "
    end = run["after"]
    found = end[f"{kind}median"], end[f"{kind}rms"], end["surface rms"], run["samples"]
    return dict(zip(FIGURES, found, strict=True))


def scene_with_truth(name: str) -> Scene:
    """A demo with points of its own where it has none; a mesh of a capture, with the reference beside it as the truth."""
    path = Path(name)
    if not path.is_file():
        return SceneSource.typed(name, None, points="automatic").load()
    reference = Mesh(*read_mesh(path.parent / REFERENCE))
    scene = SceneSource.typed(str(path.parent), path, points="automatic").load()
    return replace(scene, truth=Truth(surface=reference))


def set_constant(name: str, value: Any) -> None:
    """Change a constant in its module and wherever it was imported by its name."""
    home, constant = name.rsplit(".", 1)
    former = getattr(import_module(home), constant)
    for module in [module for module in sys.modules.values() if module.__name__.startswith("fairing.")]:
        if getattr(module, constant, None) is former:
            setattr(module, constant, value)


def ablation_table(settings: Iterable[Setting], scenes: Sequence[str], rows: Mapping[str, Mapping[str, Any]]) -> str:
    """A row for each setting: what the end's median and rms error and the cell samples are multiplied by."""
    committed = [rows[_key(scene, "", AS_COMMITTED)] for scene in scenes]
    lines = [
        "Factors of the vertices' median and rms errors, of the surface's rms distance and of the cell samples at the end of",
        "a run, geometric means over",
        f"{', '.join(_short(scene) for scene in scenes)}.",
        "",
        "| option or constant | value | off, or its alternative | halved | doubled |",
        "|---|---|---|---|---|",
    ]
    for setting in settings:
        values = setting.alternatives()
        cells = []
        for name in ALTERNATIVES:
            if name not in values:
                cells.append("-")
                continue
            found = [rows[_key(scene, setting.name, name)] for scene in scenes]
            value = f"`{_text(values[name])}`: " if name == "off" and values[name] not in (0, (0.0,)) else ""
            cells.append(value + _factors(found, committed))
        lines.append(f"| `{setting.name.removeprefix('fairing.')}` | {_text(setting.value)} | {' | '.join(cells)} |")
    ends = ", ".join(
        f"{_short(scene)} {' / '.join(f'{row[key]:.3f}' for key in FIGURES[:3])} % and {row['samples'] / 1e9:.2f} G samples"
        for scene, row in zip(scenes, committed, strict=True)
    )
    return "\n".join([*lines, "", f"As committed: {ends}."]) + "\n"


def _factors(found: Sequence[Mapping[str, Any]], committed: Sequence[Mapping[str, Any]]) -> str:
    failed = sum("failed" in row for row in found)
    if failed:
        return f"refused on {failed}"
    factors = (
        np.exp(np.mean([np.log(row[key] / before[key]) for row, before in zip(found, committed, strict=True)]))
        for key in FIGURES
    )
    return " / ".join(f"{factor:.2f}" for factor in factors)


def _short(scene: str) -> str:
    path = Path(scene)
    return f"{path.resolve().parent.name} `{path.name}`" if path.is_file() else scene


def _text(value: Any) -> str:
    return ", ".join(map(str, value)) if isinstance(value, tuple) else str(value)


def _key(scene: str, setting: str, alternative: str) -> str:
    return f"{_short(scene)} {setting} {alternative}"
