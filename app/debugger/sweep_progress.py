"""Sweep progress: how much of the present sweep is done, and the time that remains for it."""

import time

import numpy as np

from app.debugger.actions import BLOCK_NAMES
from app.debugger.commands import Command, Extent, Forward, Run
from app.debugger.work_report import WorkReport, seconds_left
from app.html import number
from fairing.run.session import Session
from fairing.run.sweep import SweepState
from fairing.trace import SchedulePosition


class SweepProgress:
    """Reports of the sweep that a command executes. It remembers when and where the sweep was first seen."""

    def __init__(self) -> None:
        self._sweep: SweepState | None = None
        self._since = self._began = self._before = 0.0

    def report(self, session: Session, command: Command | None, since: float) -> WorkReport | None:
        """The report of a command that takes at least a whole sweep, where the sweep has several blocks; else None.

        Args:
            session: read while the engine thread computes.
            since: when the command began, `time.monotonic`, s.
        """
        if not (isinstance(command, Run) or (isinstance(command, Forward) and command.extent <= Extent.SWEEP)):
            return None
        sweep, position = _present_sweep(session)
        if sweep is None or len(sweep.blocks) < 2:
            return None
        fraction, now = _fraction(sweep, position), time.monotonic()
        if self._sweep is not sweep or self._since != since:
            self._sweep, self._since, self._began, self._before = sweep, since, now, fraction
        done = (fraction - self._before) / (1 - self._before) if self._before < 1 else 0.0
        left = seconds_left(now - self._began, done)
        block = BLOCK_NAMES[session.options.schedule.order]
        text = f"{block} {number(position.block + 1, 1)} of {number(len(sweep.blocks), 1)}"
        is_to_its_end = isinstance(command, Forward) and command.extent is Extent.SWEEP
        return WorkReport(text, fraction, left) if is_to_its_end else WorkReport(text)


def _present_sweep(session: Session) -> tuple[SweepState | None, SchedulePosition]:
    """The sweep of the next step, and its position; None while it is not computed, or where the record is repeated."""
    moment, sweep, position = session.moment, session.latest_sweep, session.position
    if sweep is None or moment < len(session.trace):
        return None, position
    begun = moment if position[2:] == (0, 0) else session.trace.steps[moment - 1].sweep_moment
    is_present = (sweep.moment, sweep.context.level) == (begun, position.level)
    return (sweep if is_present else None), position


def _fraction(sweep: SweepState, position: SchedulePosition) -> float:
    """Finished fraction of a sweep by the vertices of its blocks."""
    sizes = np.array([len(block.vertices) for block in sweep.blocks], dtype=float)
    return float(sizes[: position.block].sum() / sizes.sum())
