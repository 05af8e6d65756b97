"""Timeline strip: one colour per recorded step, by the fall of the energy, the step length or the rejected share."""

import numpy as np

from app.debugger.history import REJECTIONS
from app.debugger.run_state import RunState
from app.palette import BACKGROUND, HAND, NOW, REJECTED, RGB, START
from fairing.stage_kind import StageKind
from fairing.trace import StepRecord

KINDS: dict[str, str] = {
    "energy": "Bright green: large fall of the energy, or of a fit's objective (0.001 % to 10 %). "
    "Pink: rejected steps. White: manual edits.",
    "step": "Bright red: long steps (the longest of the step, 0.01 to 10 px in a photo). White: manual edits.",
    "rejected": "Pink: share of the vertices whose step was rejected. White: manual edits.",
}
MAX_PIXELS = 2000  # width of a strip, px


class StepHistory:
    """Four numbers from 0 to 1 per step: fall of the energy, longest step, rejected share, and 1 for a manual edit."""

    def __init__(self) -> None:
        self._run_id = -1
        self._values = np.zeros((0, 4), dtype=np.float32)

    def update(self, state: RunState) -> None:
        """Add the steps recorded since the last update; a different run starts over."""
        if state.run_id != self._run_id:
            self._run_id = state.run_id
            self._values = np.zeros((0, 4), dtype=np.float32)
        new = [_measures(record) for record in state.trace.steps[len(self._values) : state.length]]
        if new:
            self._values = np.concatenate([self._values, np.array(new, dtype=np.float32)])

    def picture(self, kind: str) -> np.ndarray:
        """(1, w, 3) uint8: one pixel per step; for long records one pixel per group of steps, with its maximum."""
        group = max(1, -(-len(self._values) // MAX_PIXELS))
        padded = np.concatenate([self._values, np.repeat(self._values[-1:], -len(self._values) % group, axis=0)])
        fall, length, rejected, manual = padded.reshape(-1, group, 4).max(axis=1).T
        if kind == "step":
            colors = _towards(_base(len(length)), NOW, length)
        elif kind == "rejected":
            colors = _towards(_base(len(rejected)), REJECTED, rejected)
        else:
            colors = _towards(_towards(_base(len(fall)), START, 0.15 + 0.85 * fall), REJECTED, rejected)
        return np.round(_towards(colors, HAND, manual)).astype(np.uint8)[None]


def _base(count: int) -> np.ndarray:
    return np.tile(np.array(BACKGROUND, dtype=float) + 14, (count, 1))


def _towards(colors: np.ndarray, target: RGB, part: np.ndarray) -> np.ndarray:
    return colors + part[:, None] * (np.array(target) - colors)


def _measures(record: StepRecord) -> tuple[float, float, float, float]:
    if record.stage is StageKind.MANUAL:
        return 0.0, 0.0, 0.0, 1.0
    before, after = record.energy_before, record.energy_after
    if record.stage.is_fit and len(record.faces) == 0:
        before, after = record.objective_before, record.objective_after
    fall = max(0.0, (before - after) / before) if before > 0 else 0.0
    moved = (record.before != record.after).any(axis=1)
    length = float(record.step_px[moved].max(initial=0))
    rejected = float(np.isin(record.reasons, REJECTIONS).mean()) if len(record.reasons) else 0.0
    return _log_part(fall, 1e-5, 1e-1), _log_part(length, 1e-2, 1e1), rejected, 0.0


def _log_part(value: float, low: float, high: float) -> float:
    """Position of a value between `low` and `high` on a logarithmic scale, 0 to 1."""
    return float(np.clip(np.log(max(value, 1e-300) / low) / np.log(high / low), 0, 1))
