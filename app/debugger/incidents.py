"""Incidents: failures of the debugger itself, kept for the notification and the problem report."""

import time
from collections import deque
from dataclasses import dataclass
from typing import Literal

MAX_INCIDENTS = 20  # kept; the oldest is dropped

Kind = Literal["dead", "stuck", "error"]


@dataclass(frozen=True)
class Incident:
    """A failure that is not a user's error.

    Attributes:
        what: "dead" or "stuck" for a thread, "error" for an unexpected exception.
        where: the thread, command or property.
        summary: one sentence for the notification.
        details: traceback, or the call stack of a stuck thread.
        time: local time, ISO 8601.
    """

    what: Kind
    where: str
    summary: str
    details: str
    time: str


class Incidents:
    """The last incidents. The caller holds the controller's lock."""

    def __init__(self) -> None:
        self._items: deque[Incident] = deque(maxlen=MAX_INCIDENTS)

    @property
    def items(self) -> tuple[Incident, ...]:
        """The newest last."""
        return tuple(self._items)

    @property
    def latest(self) -> Incident | None:
        return self._items[-1] if self._items else None

    def add(self, what: Kind, where: str, summary: str, details: str) -> bool:
        """Add an incident; returns False if the previous one with the same summary is still listed."""
        is_new = all(item.summary != summary for item in self._items)
        if is_new or what != "error":
            self._items.append(Incident(what, where, summary, details, time.strftime("%Y-%m-%dT%H:%M:%S")))
        return is_new
