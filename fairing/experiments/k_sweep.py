"""Dimensions experiment: final error against the eigenspace's dimensions k, and the misalignment that it absorbs."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from fairing.errors import InputError
from fairing.experiments.experiment import Row
from fairing.experiments.setting import Setting
from fairing.judge.inspect import FaceCells, face_cells
from fairing.options import CellOptions, FairingOptions
from fairing.run.session import Session

START_PERCENT = 10.0
MISALIGNED_PERCENT = 2.0
BLUR = 2.0  # px: blur of the photos in which the misalignment is measured
CELL_SIZE = 64  # samples along a leg


@dataclass(frozen=True)
class KSweep:
    """Runs with every k, and the part of a misalignment that the eigenspace absorbs before any step."""

    name: ClassVar[str] = "k-sweep"
    title: ClassVar[str] = "Dimensions of the eigenspace"
    question: ClassVar[str] = (
        "How many dimensions k should the eigenspace have, and how much misalignment does it absorb?"
    )
    columns: ClassVar[dict[str, str]] = {
        "k": "dimensions of the eigenspace, at all levels",
        "direction": "index of the direction",
        "end_percent": "final error, % of the edge",
        "left_percent": "squared residual of a misalignment of 2 % of the edge with the refitted eigenspace, % of that with the "
        "true eigenspace",
        "steps": "steps of the run",
    }

    dimensions: tuple[int, ...] = ()
    """Values of k, the same at all levels. Default: all from 1 to the number of views minus two."""
    directions: int = 2
    """Number of directions in which the vertex is displaced by 10 % of the edge."""

    def cases(self, setting: Setting) -> list[Row]:
        most = largest_k(setting)
        if self.dimensions and not 1 <= min(self.dimensions) <= max(self.dimensions) <= most:
            raise InputError(
                f"dimensions: expected values of k from 1 to {most}, the number of views of a face minus two"
            )
        wanted = self.dimensions or tuple(range(1, most + 1))
        return [{"k": k, "direction": d} for d in range(self.directions) for k in wanted]

    def measure(self, setting: Setting, case: Row) -> Row:
        direction = setting.directions(self.directions)[case["direction"]]
        scene = setting.displaced(START_PERCENT, direction)
        session = setting.session(scene, setting.options.with_levels(dimensions=case["k"]))
        session.run()
        return {
            "end_percent": setting.distance(session.vertices),
            "left_percent": 100 * part_left(setting, case["k"], direction),
            "steps": len(session.trace),
        }

    def finding(self, rows: Sequence[Row]) -> str:
        by_k = {k: [row for row in rows if row["k"] == k] for k in sorted({row["k"] for row in rows})}
        if len(by_k) < 2:
            return ""
        end = {k: float(np.median([row["end_percent"] for row in here])) for k, here in by_k.items()}
        left = {k: float(np.median([row["left_percent"] for row in here])) for k, here in by_k.items()}
        best, last = min(end, key=lambda k: end[k]), max(end)
        return (
            f"The final error is least with k = {best}, {end[best]:.2g} % of the edge; with k = {last} it is {end[last]:.2g} %. "
            f"The eigenspace absorbs all but {left[min(left)]:.2g} % of a misalignment with k = {min(left)}, and all but "
            f"{left[last]:.2g} % with k = {last}."
        )


def largest_k(setting: Setting) -> int:
    """Largest possible k: the number of views minus two of the one-ring face with the fewest views.

    Raises:
        InputError: that is less than one.
    """
    context = _at_one_level(setting, 0.0, np.zeros(3)).sweep_state().context
    views = int(context.n_views[setting.scene.mesh.one_rings[setting.vertex]].min())
    if views < 3:
        raise InputError(f"vertex {setting.vertex}: a face around it is seen in {views} photos; choose another vertex")
    return views - 2


def part_left(setting: Setting, k: int, direction: np.ndarray) -> float:
    """Part of the squared residual that remains with a refitted eigenspace, of what a misalignment adds under the true one.

    Even with k = 1 refitting leaves so little that a step with a fixed eigenspace is many times too short: U follows the
    texture wherever the vertex drags it.

    Args:
        k: dimensions.
        direction: (3,) float: unit vector of the misalignment.
    """
    aligned, off = (_at_one_level(setting, percent, direction) for percent in (0.0, MISALIGNED_PERCENT))
    held = refitted = least = 0.0
    for face in setting.scene.mesh.one_rings[setting.vertex].tolist():
        first, second = face_cells(aligned, face), face_cells(off, face)
        _, mine, theirs = np.intersect1d(first.views, second.views, return_indices=True)
        shown = np.all(first.counts[mine] & second.counts[theirs], axis=0)
        true, moved = _weighted(first, mine, shown), _weighted(second, theirs, shown)
        _, true_values, rows = np.linalg.svd(true, full_matrices=False)
        held += float(((moved - moved @ rows[:k].T @ rows[:k]) ** 2).sum())
        refitted += float((np.linalg.svd(moved, compute_uv=False)[k:] ** 2).sum())
        least += float((true_values[k:] ** 2).sum())
    return max(0.0, refitted - least) / max(held - least, 1e-300)


def _weighted(cells: FaceCells, views: np.ndarray, shown: np.ndarray) -> np.ndarray:
    """(n, p) float: cells of some views (ids) at the samples `shown` (bool), weighted as in the energy."""
    return cells.observed[np.ix_(views, shown)] * np.sqrt(cells.pair_weight[views])[:, None]


def _at_one_level(setting: Setting, percent: float, direction: np.ndarray) -> Session:
    """A run at its start, with a single level and cells of one size, so that cells are comparable sample by sample."""
    options: FairingOptions = setting.options
    cells = CellOptions(warp=options.cells.warp, adaptive=False, weighting=options.cells.weighting)
    options = replace(options, cells=cells, schedule=replace(options.schedule, first_level="first"))
    options = options.with_levels(
        blur=BLUR, size=CELL_SIZE, inset=0.0, interpolation="bilinear", point_spread="as_seen", smoothing=0.0
    )
    return setting.session(setting.displaced(percent, direction), options)
