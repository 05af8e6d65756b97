"""How far away may a vertex start? The error at the end over the error at the start, from several directions."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from fairing.experiments.experiment import Row
from fairing.experiments.setting import Setting

LOST = 0.1  # a vertex is back when it has kept at most this part of its error


@dataclass(frozen=True)
class CaptureRange:
    """Runs from several distances in several directions."""

    name: ClassVar[str] = "capture-range"
    title: ClassVar[str] = "Capture range"
    question: ClassVar[str] = "How far off may a vertex start and still come back to its place?"
    columns: ClassVar[dict[str, str]] = {
        "start_percent": "error at the start, % of the edge",
        "direction": "number of the direction, from 0",
        "end_percent": "error at the end, % of the edge",
        "steps": "steps of the run",
    }

    starts: tuple[float, ...] = (10.0, 20.0, 30.0, 40.0, 50.0, 60.0)
    """Errors at the start, percent of the shortest edge at the vertex."""
    directions: int = 6
    """How many directions, spread over the sphere."""

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
        safe, first_lost = 0.0, ""
        for start in sorted({row["start_percent"] for row in rows}):
            here = [row for row in rows if row["start_percent"] == start]
            back = sum(is_back(row) for row in here)
            if back < len(here):
                first_lost = f" From {start:g} % it came back from {back} of {len(here)}."
                break
            safe = start
        directions = len({row["direction"] for row in rows})
        if not safe:
            return f"At no distance did the vertex come back from every direction.{first_lost}"
        ends = [row["end_percent"] for row in rows if row["start_percent"] <= safe]
        ways = "the direction tried" if directions == 1 else f"all {directions} directions tried"
        return (
            f"From up to {safe:g} % of the edge the vertex came back from {ways} (to {max(ends):.2g} % or nearer)."
            f"{first_lost}"
        )


def is_back(row: Row) -> bool:
    """Whether the vertex has lost nearly all of its error."""
    return row["end_percent"] <= LOST * row["start_percent"]
