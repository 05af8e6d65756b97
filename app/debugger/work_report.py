"""Work report: what the engine does at present, how much of it is done, and the time that remains."""

import time
from collections.abc import Sequence
from dataclasses import dataclass

from app.html import duration
from fairing.work import Work, fraction_done

NOTICEABLE = 0.3  # s: shorter computations are not reported
SHOWN_AFTER = 1.0  # s: the time that remains is estimated from then on
COUNTED_AFTER = 3.0  # s: without an estimate, the time so far is shown from then on
LEAST_DONE = 0.02  # fraction, for the same


@dataclass(frozen=True)
class WorkReport:
    """What the engine does at present.

    Attributes:
        text: one line, such as "searching 81 vertices: direction 6 of 15".
        fraction: finished part, 0 to 1; None if unknown.
        seconds_left: estimate, s; None if unknown.
        seconds: time so far, s, shown where `seconds_left` is unknown; None: not shown.
    """

    text: str
    fraction: float | None = None
    seconds_left: float | None = None
    seconds: float | None = None

    @property
    def sentence(self) -> str:
        """The text with a capital."""
        return f"{self.text[:1].upper()}{self.text[1:]}"

    @property
    def time(self) -> str:
        """The time that remains, else the time so far; empty without both."""
        if self.seconds_left is not None:
            return f"{duration(self.seconds_left)} left"
        return "" if self.seconds is None else duration(self.seconds)

    @property
    def line(self) -> str:
        """The sentence and the time."""
        return f"{self.sentence}; {self.time}" if self.time else self.sentence


def report_of(works: Sequence[Work]) -> WorkReport | None:
    """The report of nested works, the outermost first; None without any that has taken noticeable time.

    The text is that of the outermost work, since two do not fit in a line; the fraction includes the others.
    """
    if not works or time.monotonic() - works[0].began < NOTICEABLE:
        return None
    seconds = time.monotonic() - works[0].began
    fraction = None if all(work.count == 1 and work.done == 0 for work in works) else fraction_done(works)
    left = seconds_left(seconds, fraction or 0.0)
    return WorkReport(text_of(works[0]), fraction, left, float(round(seconds)) if seconds >= COUNTED_AFTER else None)


def text_of(work: Work) -> str:
    """One line: the work, and which of its parts is in progress, or how many are finished."""
    if work.count == 1:
        return work.text
    if work.part:
        return f"{work.text}: {work.part} {min(work.done + 1, work.count)} of {work.count}"
    return f"{work.text}, {work.done} of {work.count}"


def seconds_left(seconds: float, fraction: float) -> float | None:
    """Estimate from the time so far, s, in which a fraction was done; None as long as it would be too uncertain."""
    if seconds < SHOWN_AFTER or fraction < LEAST_DONE:
        return None
    return float(round(seconds * (1 - fraction) / fraction))
