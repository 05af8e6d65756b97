"""Capture range experiment: final error against initial error, from several directions."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from fairing.experiments.experiment import Row
from fairing.experiments.setting import Setting

CONVERGED = 0.1  # a run converged if at most this part of the initial error remains


@dataclass(frozen=True)
class CaptureRange:
    """Runs from several distances in several directions."""

    name: ClassVar[str] = "capture-range"
    title: ClassVar[str] = "Capture range"
    question: ClassVar[str] = "How far from its true position may a vertex start and still converge?"
    columns: ClassVar[dict[str, str]] = {
        "start_percent": "initial error, % of the edge",
        "direction": "index of the direction",
        "end_percent": "final error, % of the edge",
        "steps": "steps of the run",
    }

    starts: tuple[float, ...] = (10.0, 20.0, 30.0, 40.0, 50.0, 60.0)
    """Initial errors, percent of the shortest edge at the vertex."""
    directions: int = 6
    """Number of directions, spread over the sphere."""

    def cases(self, setting: Setting) -> list[Row]:
        return [{"start_percent": s, "direction": d} for d in range(self.directions) for s in self.starts]

    def measure(self, setting: Setting, case: Row) -> Row:
        direction = setting.directions(self.directions)[case["direction"]]
        session = setting.session(setting.displaced(case["start_percent"], direction))
        session.run()
        return {"end_percent": setting.distance(session.vertices), "steps": len(session.trace)}

    def finding(self, rows: Sequence[Row]) -> str:
        if not rows:
            return ""
        safe, first_failure = 0.0, ""
        for start in sorted({row["start_percent"] for row in rows}):
            here = [row for row in rows if row["start_percent"] == start]
            converged = sum(has_converged(row) for row in here)
            if converged < len(here):
                first_failure = f" From {start:g} % it converged from {converged} of {len(here)} directions."
                break
            safe = start
        directions = len({row["direction"] for row in rows})
        if not safe:
            return f"The vertex did not converge from every direction at any distance.{first_failure}"
        ends = [row["end_percent"] for row in rows if row["start_percent"] <= safe]
        tried = "the one direction tried" if directions == 1 else f"all {directions} directions tried"
        return (
            f"From up to {safe:g} % of the edge the vertex converged from {tried} (to {max(ends):.2g} % or less)."
            f"{first_failure}"
        )


def has_converged(row: Row) -> bool:
    """Whether at most `CONVERGED` of the initial error remains."""
    return row["end_percent"] <= CONVERGED * row["start_percent"]
