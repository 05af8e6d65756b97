"""Sweep progress: how much of the present sweep is done, and the time that remains for it."""

import time
from collections.abc import Sequence

import numpy as np

from app.debugger.actions import BLOCK_NAMES
from app.debugger.commands import Command, Extent, Forward, Run
from app.debugger.work_report import WorkReport, seconds_left, text_of
from app.html import number
from fairing.run.phases import GaussNewton, LocalSearch
from fairing.run.session import Session
from fairing.run.sweep import SweepState
from fairing.trace import SchedulePosition
from fairing.work import Work, fraction_done


class SweepProgress:
    """Reports of the sweep that a command executes. It remembers when and where the sweep was first seen."""

    def __init__(self) -> None:
        self._sweep: SweepState | None = None
        self._since = self._began = self._before = 0.0

    def report(
        self, session: Session, command: Command | None, since: float, works: Sequence[Work]
    ) -> WorkReport | None:
        """The report of a command that takes at least a whole sweep, where the sweep has several blocks; else None.

        Args:
            session: read while the engine thread computes.
            since: when the command began, `time.monotonic`, s.
            works: in progress, the outermost first.
        """
        if not (isinstance(command, Run) or (isinstance(command, Forward) and command.extent <= Extent.SWEEP)):
            return None
        sweep, position = _present_sweep(session)
        if sweep is None or len(sweep.blocks) < 2:
            return None
        is_search = isinstance(sweep.phase, LocalSearch)
        if is_search and not works:
            return None
        fraction, now = _fraction(sweep, position, works if is_search else ()), time.monotonic()
        if self._sweep is not sweep or self._since != since:
            self._sweep, self._since, self._began, self._before = sweep, since, now, fraction
        done = (fraction - self._before) / (1 - self._before) if self._before < 1 else 0.0
        left = seconds_left(now - self._began, done)
        if is_search:
            return WorkReport(text_of(works[0]), fraction, left)
        block = BLOCK_NAMES[session.options.schedule.order]
        text = f"{block} {number(position.block + 1, 1)} of {number(len(sweep.blocks), 1)}"
        is_to_its_end = isinstance(command, Forward) and command.extent is Extent.SWEEP
        return WorkReport(text, fraction, left) if is_to_its_end else WorkReport(text)


def _present_sweep(session: Session) -> tuple[SweepState | None, SchedulePosition]:
    """The sweep of the next step, and its position; None while it is not computed, or where the record is repeated."""
    moment, sweep, position = session.moment, session.latest_sweep, session.position
    if sweep is None or moment < len(session.trace) or not isinstance(sweep.phase, GaussNewton | LocalSearch):
        return None, position
    begun = moment if position[2:] == (0, 0) else session.trace.steps[moment - 1].sweep_moment
    is_present = (sweep.moment, sweep.context.level) == (begun, position.level)
    return (sweep if is_present else None), position


def _fraction(sweep: SweepState, position: SchedulePosition, works: Sequence[Work]) -> float:
    """Finished fraction of a sweep by the vertices of its blocks; `works` are those of the block in progress."""
    sizes = np.array([len(block.vertices) for block in sweep.blocks], dtype=float)
    done = sizes[: position.block].sum() + (fraction_done(works) * sizes[position.block : position.block + 1]).sum()
    return float(done / sizes.sum())
