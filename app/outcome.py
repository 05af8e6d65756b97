"""What a step did, in words."""

import numpy as np

from fairing.trace import StepReason, StepRecord


def step_outcome(record: StepRecord) -> str:
    """One line: the reason of a single vertex, or how many vertices had which."""
    if len(record.vertices) == 0:
        return "nothing to move on this level"
    if len(record.vertices) == 1:
        return StepReason(int(record.reasons[0])).text
    found, counts = np.unique(record.reasons, return_counts=True)
    parts = [
        f"{count} {StepReason(int(reason)).text.split(':')[0]}"
        for reason, count in sorted(zip(found, counts, strict=True), key=lambda pair: -pair[1])
    ]
    return "vertices: " + ", ".join(parts)


def reason_of(record: StepRecord, vertex: int) -> StepReason | None:
    """What became of a vertex in a step; None if the step was not about it."""
    slot = slot_of(record, vertex)
    return None if slot is None else StepReason(int(record.reasons[slot]))


def slot_of(record: StepRecord, vertex: int) -> int | None:
    """Where a vertex stands in a record's arrays."""
    found = np.flatnonzero(record.vertices == vertex)
    return int(found[0]) if len(found) else None
