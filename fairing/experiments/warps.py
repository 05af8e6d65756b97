"""Warp and solver experiment: affine or homography, alternating or variable projection, error step by step."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from fairing.experiments.experiment import Row
from fairing.experiments.setting import Setting

VARIANTS = [(warp, solver) for warp in ("affine", "homography") for solver in ("alternating", "variable_projection")]


@dataclass(frozen=True)
class WarpComparison:
    """The four combinations from the same starts."""

    name: ClassVar[str] = "warps"
    title: ClassVar[str] = "Warps and solvers"
    question: ClassVar[str] = (
        "How much accuracy do the exact homography and variable projection gain over the paper's choices?"
    )
    columns: ClassVar[dict[str, str]] = {
        "warp": "affine (the paper) or homography",
        "solver": "alternating (the paper) or variable_projection",
        "start_percent": "initial error, % of the edge",
        "direction": "index of the direction",
        "end_percent": "final error, % of the edge",
        "steps": "steps of the run",
    }

    starts: tuple[float, ...] = (10.0, 20.0)
    """Initial errors, percent of the shortest edge at the vertex."""
    directions: int = 3
    """Number of directions, spread over the sphere."""

    def cases(self, setting: Setting) -> list[Row]:
        return [
            {"warp": warp, "solver": solver, "start_percent": start, "direction": direction}
            for direction in range(self.directions)
            for start in self.starts[::-1]
            for warp, solver in VARIANTS
        ]

    def measure(self, setting: Setting, case: Row) -> Row:
        """The columns, and `path`: the initial error and the error after each step, % of the edge."""
        direction = setting.directions(self.directions)[case["direction"]]
        options = replace(
            setting.options,
            cells=replace(setting.options.cells, warp=case["warp"]),
            step=replace(setting.options.step, solver=case["solver"]),
        )
        session = setting.session(setting.displaced(case["start_percent"], direction), options)
        path = [setting.distance(session.vertices)]
        session.run(on_step=lambda _: path.append(setting.distance(session.vertices)))
        return {"end_percent": path[-1], "steps": len(session.trace), "path": path}

    def finding(self, rows: Sequence[Row]) -> str:
        ends = {
            variant: [row["end_percent"] for row in rows if (row["warp"], row["solver"]) == variant]
            for variant in VARIANTS
        }
        if not all(ends.values()):
            return ""
        medians = {variant: float(np.median(values)) for variant, values in ends.items()}
        summary = "; ".join(
            f"{warp}, {solver.replace('_', ' ')} {medians[warp, solver]:.2g}" for warp, solver in VARIANTS
        )
        return f"Median final error, % of the edge: {summary}."
