"""Moment ids: `level:sweep:vertex:iteration` of the step after a moment, counted from 1; or `start`; or `end`."""

import re
from collections.abc import Callable

from fairing.errors import InputError
from fairing.trace import SchedulePosition, Trace

START, END = "start", "end"
BEFORE_ALL = SchedulePosition(-1, 0, 0, 0)
_ID = re.compile(r"([1-9]\d{0,8}):([1-9]\d{0,8}):([1-9]\d{0,8}):([1-9]\d{0,8})")


def moment_id(position: SchedulePosition, moment: int, n_levels: int) -> str:
    """The id, for `--at`, of the moment before the step at a position."""
    if moment == 0:
        return START
    return END if position.level >= n_levels else ":".join(str(part + 1) for part in position)


def parse_moment_id(text: str, n_levels: int) -> SchedulePosition:
    """The position that a moment id denotes; `BEFORE_ALL` for `start`, the one after the last level for `end`.

    Raises:
        InputError: the text is not a moment id, or there is no such level.
    """
    found = _ID.fullmatch(text.strip())
    if text.strip() == START:
        return BEFORE_ALL
    if text.strip() == END:
        return SchedulePosition(n_levels, 0, 0, 0)
    if found is None:
        raise InputError(
            f"--at {text:.60}: expected level:sweep:vertex:iteration, each from 1, such as 2:1:3:1, or {START} or {END}"
        )
    position = SchedulePosition(*(int(part) - 1 for part in found.groups()))
    if position.level >= n_levels:
        raise InputError(f"--at {text}: expected a level from 1 to {n_levels}, found {position.level + 1}")
    return position


def find_moment(trace: Trace, wanted: SchedulePosition) -> int:
    """The first recorded moment at or after a position; the last moment if the record ends before.

    A branch may pass a position twice; the first time counts.
    """
    if wanted == BEFORE_ALL or not trace.steps:
        return 0
    positions = [trace.steps[0].position, *(record.next_position for record in trace.steps)]
    if wanted in positions:
        return positions.index(wanted)
    order = _order(trace)
    reached = (moment for moment, position in enumerate(positions) if order(position) > order(wanted))
    return next(reached, len(trace.steps))


def _order(trace: Trace) -> Callable[[SchedulePosition], tuple[int, ...]]:
    """Sorts positions by when they are executed; by themselves in a record without a plan."""
    if trace.plan is None:
        return tuple
    from fairing.options import options_from_dict  # the engine is imported after the page is served
    from fairing.run.phases import schedule_of

    return schedule_of(options_from_dict(trace.header["options"]), trace.plan).order_of
