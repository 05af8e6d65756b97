"""Publisher: holds the newest run state and delivers it to listeners on its own thread."""

import logging
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from app.debugger.run_state import RunState
from app.worker_thread import WorkerThread

INTERVAL = 0.06  # s: at most 16 states a second while something runs; steps between reduce it to 10 to 15
POLL = 0.15  # s

Listener = Callable[[RunState], None]
_Delivery = tuple[RunState, list[Listener]]


class Publisher:
    """Slow listeners miss states, but never the last one. A listener that raises is logged; the others are still called.

    Args:
        changed: the controller's lock.
        state: the first state.
        poll: returns fields of the state that may have changed without an update, such as the progress of a command;
            called with the lock held.
        on_failure: called with what a listener raised.
    """

    def __init__(
        self,
        changed: threading.Condition,
        state: RunState,
        poll: Callable[[], Mapping[str, Any]],
        on_failure: Callable[[Exception], None],
    ) -> None:
        self._changed, self._poll, self._on_failure = changed, poll, on_failure
        self.state = state
        """The newest state."""
        self._listeners: list[Listener] = []
        self._in_call: list[Listener] = []
        self._is_unpublished = False
        self._kept: Mapping[str, Any] = {}
        self._updated = 0.0
        self.worker: WorkerThread[_Delivery] = WorkerThread("publisher", changed, self._take, self._deliver, POLL)

    @property
    def is_due(self) -> bool:
        """Whether `INTERVAL` has passed since the last update; what was polled does not count, or it would hold back the
        state after a step until the next step ends."""
        return time.monotonic() - self._updated > INTERVAL

    def busy_seconds(self) -> float:
        """Time that the delivery in progress has taken."""
        return self.worker.busy_seconds

    def update(self, **changes: Any) -> None:
        """Publish a state with these fields replaced."""
        with self._changed:
            kept, self._kept = self._kept, {}
            self._updated = time.monotonic()
            self._replace({**kept, **changes})

    def update_when_due(self, **changes: Any) -> None:
        """The same as soon as `INTERVAL` has passed since the last update, or with the next update if that is earlier."""
        with self._changed:
            if self.is_due:
                self.update(**changes)
            else:
                self._kept = changes

    def _replace(self, changes: Mapping[str, Any]) -> None:
        self.state = replace(self.state, serial=self.state.serial + 1, **changes)
        self._is_unpublished = True
        self._changed.notify_all()

    def republish(self) -> None:
        """Deliver the newest state again."""
        with self._changed:
            self._is_unpublished = True
            self._changed.notify_all()

    def subscribe(self, listener: Listener) -> Callable[[], None]:
        """Call `listener` with the present state and all later ones. Returns a function that ends the subscription."""
        with self._changed:
            self._listeners.append(listener)
        self.republish()

        def unsubscribe() -> None:
            with self._changed:
                if listener in self._listeners:
                    self._listeners.remove(listener)

        return unsubscribe

    def _take(self) -> _Delivery | None:
        if self._kept and self.is_due:
            self.update(**self._kept)
        changes = {name: value for name, value in self._poll().items() if getattr(self.state, name) != value}
        if changes:
            self._replace(changes)
        if not self._is_unpublished:
            return None
        self._is_unpublished = False
        return self.state, list(self._listeners)

    def _deliver(self, delivery: _Delivery) -> None:
        state, listeners = delivery
        for listener in listeners:
            if listener in self._in_call:  # on a publisher thread that was replaced because of it
                continue
            self._in_call.append(listener)
            try:
                listener(state)
            except Exception as error:
                logging.getLogger(__name__).exception("a listener failed")
                self._on_failure(error)
            finally:
                self._in_call.remove(listener)
            if not self.worker.is_current:
                self.republish()
                return
