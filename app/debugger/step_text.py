"""What a step did, in words."""

from collections import Counter

import numpy as np

from fairing.trace import StepReason, StepRecord


def step_outcome(record: StepRecord) -> str:
    """One line: the reason of a single vertex, or how many vertices had which."""
    if len(record.vertices) == 0:
        return "nothing to move on this level"
    if len(record.vertices) == 1:
        return f"vertex {int(record.vertices[0])} {StepReason(int(record.reasons[0])).text}"
    counts = Counter(short_reason(StepReason(int(reason))) for reason in record.reasons)
    return "vertices: " + ", ".join(f"{count} {reason}" for reason, count in counts.most_common())


def short_reason(reason: StepReason) -> str:
    """The word or two before the explanation."""
    return reason.text.split(":")[0]


def slot_of(record: StepRecord, vertex: int) -> int | None:
    """Where a vertex stands in a record's arrays."""
    found = np.flatnonzero(record.vertices == vertex)
    return int(found[0]) if len(found) else None
