"""Command queue: the commands that wait for the engine thread, and which of them replace each other."""

from collections import deque
from collections.abc import Callable

from app.debugger.actions import label_of
from app.debugger.commands import Command, JumpTo, Pause, Query

HISTORY = 50  # commands kept for a problem report


class CommandQueue:
    """Waiting commands, first in, first out; queries come after all others. The caller holds the controller's lock.

    A repeated command is dropped, so that a key held down leaves no queue; `Pause` drops all commands but queries; of
    several jumps, and of queries with the same key, only the last one counts.
    """

    def __init__(self) -> None:
        self._waiting: deque[Command] = deque()
        self.history: deque[Command] = deque(maxlen=HISTORY)
        """The last commands added, without queries; the newest last."""

    @property
    def has_commands(self) -> bool:
        """Whether anything but queries waits."""
        return any(not isinstance(waiting, Query) for waiting in self._waiting)

    def add(self, command: Command) -> bool:
        """Add a command; returns False for one that repeats a waiting one."""
        if isinstance(command, Pause):
            self.drop_commands()
        elif isinstance(command, Query):
            self._drop(lambda waiting: isinstance(waiting, Query) and waiting.key == command.key)
        elif isinstance(command, JumpTo):
            self._drop(lambda waiting: isinstance(waiting, JumpTo))
        if command in self._waiting:
            return False
        self._waiting.append(command)
        if not isinstance(command, Query):
            self.history.append(command)
        return True

    def add_again(self, query: Query) -> None:
        """Add a query that was cancelled, unless a newer one with its key waits."""
        if not any(isinstance(waiting, Query) and waiting.key == query.key for waiting in self._waiting):
            self._waiting.append(query)

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels of the commands that wait, without queries."""
        return tuple(label_of(command) for command in self._waiting if not isinstance(command, Query))

    def take(self) -> Command | None:
        """Remove and return the first command, or the first query if no command waits; None if nothing waits."""
        if not self._waiting:
            return None
        first = next((waiting for waiting in self._waiting if not isinstance(waiting, Query)), self._waiting[0])
        self._waiting.remove(first)
        return first

    def drop_commands(self) -> None:
        """Drop all but the queries."""
        self._drop(lambda waiting: not isinstance(waiting, Query))

    def clear(self) -> None:
        self._waiting.clear()

    def _drop(self, matches: Callable[[Command], bool]) -> None:
        self._waiting = deque(waiting for waiting in self._waiting if not matches(waiting))
