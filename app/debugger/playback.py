"""Playback: shows the recorded moments one after another at a given rate. Breakpoints are not checked."""

import time
from collections.abc import Callable

from app.debugger.cancellation import Cancellation
from fairing.run.session import Session

MIN_RATE, MAX_RATE = 0.001, 1000.0  # moments per second
FRAME_SECONDS = 0.06  # the least time between two frames: at most 16 frames a second


def play(session: Session, rate: float, cancellation: Cancellation, publish: Callable[[], None]) -> str:
    """Play to the end of the record, from its start if the session is at the end; returns why it stopped.

    Args:
        rate: moments per second, limited to `MIN_RATE` to `MAX_RATE`; moments are skipped where frames are slower.
        publish: shows the present moment.
    """
    rate = min(max(rate, MIN_RATE), MAX_RATE) if rate == rate else MIN_RATE
    last = len(session.trace)
    if session.moment == last:
        session.go_to(0)
    began, first = time.monotonic(), session.moment
    while session.moment < last:
        publish()
        due = began + (session.moment + 1 - first) / rate - time.monotonic()
        if cancellation.wait(max(due, FRAME_SECONDS)):
            return "paused"
        session.go_to(min(last, max(session.moment + 1, first + int((time.monotonic() - began) * rate))))
    return "at the end of the record"
