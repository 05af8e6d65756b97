"""An experiment: where a run ends with and without damping in every step."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

from fairing.experiments import Row, Setting


@dataclass(frozen=True)
class Damping:
    """Runs with the vertex displaced in some directions."""

    name: ClassVar[str] = "damping"
    title: ClassVar[str] = "Damping in every step"
    question: ClassVar[str] = "Does damping in every step change where a run ends?"
    columns: ClassVar[dict[str, str]] = {
        "damped": "whether every step is damped",
        "direction": "index of the direction",
        "end_percent": "final error, % of the edge",
        "steps": "steps of the run",
    }

    directions: int = 2
    """Number of directions in which the vertex is displaced by 5 % of the edge."""

    def cases(self, setting: Setting) -> list[Row]:
        return [{"damped": damped, "direction": d} for d in range(self.directions) for damped in (False, True)]

    def measure(self, setting: Setting, case: Row) -> Row:
        options = replace(setting.options, step=replace(setting.options.step, damping_always=case["damped"]))
        scene = setting.displaced(5.0, setting.directions(self.directions)[case["direction"]])
        session = setting.session(scene, options)
        session.run()
        return {"end_percent": setting.distance(session.vertices), "steps": len(session.trace)}

    def finding(self, rows: Sequence[Row]) -> str:
        steps = {damped: [row["steps"] for row in rows if row["damped"] == damped] for damped in (False, True)}
        if not all(steps.values()):
            return ""
        means = [sum(counts) / len(counts) for counts in steps.values()]
        return f"Without damping a run takes {means[0]:.0f} steps, with damping {means[1]:.0f}."
