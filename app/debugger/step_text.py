"""Step text: one line about the outcome of a step."""

from collections import Counter

import numpy as np

from fairing.stage_kind import StageKind
from fairing.trace import StepReason, StepRecord


def step_outcome(record: StepRecord) -> str:
    """The reason of a single vertex, or the number of vertices for each reason."""
    if len(record.vertices) == 0:
        return "no vertex goes back" if record.stage is StageKind.JUDGE else "no vertex to move on this level"
    if len(record.vertices) == 1:
        return f"vertex {int(record.vertices[0])} {StepReason(int(record.reasons[0])).text}"
    counts = Counter(short_reason(StepReason(int(reason))) for reason in record.reasons)
    if len(counts) == 1:
        return f"{len(record.reasons)} vertices {next(iter(counts))}"
    return "vertices: " + ", ".join(f"{count} {reason}" for reason, count in counts.most_common())


def short_reason(reason: StepReason) -> str:
    """A reason without its explanation."""
    return reason.text.split(":")[0]


def slot_of(record: StepRecord, vertex: int) -> int | None:
    """Index of a vertex in the arrays of a record; None if the step does not include it."""
    found = np.flatnonzero(record.vertices == vertex)
    return int(found[0]) if len(found) else None
