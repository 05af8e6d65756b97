"""Callback queues: the callbacks of every client run from a bounded queue of its own.

viser 1.1.1 runs the callbacks of all clients on one pool of 32 threads with one queue without a bound. A client that
sends thousands of messages would fill it, and the pages of new clients, which a callback builds, would wait behind them
(ledger: flood of forged messages).
"""

import logging
import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from typing import Any

import viser

MAX_QUEUED = 64  # callbacks of one client; of more the oldest are dropped
MAX_RUNNING = 2  # callbacks of one client at a time: a long one does not block the next
LONG_SECONDS = 0.5  # a callback that runs for longer is not waited for by the next one of its client
EVENT_THREADS, CONNECTION_THREADS = 32, 8

Call = tuple[Callable[..., Any], tuple[Any, ...], "Future[Any]"]


class _Queue:
    """The waiting callbacks of one client.

    Attributes:
        latest: of the callback that began last.
    """

    def __init__(self, max_running: int, max_queued: int | None) -> None:
        self.waiting: deque[Call] = deque(maxlen=max_queued)
        self.max_running, self.running = max_running, 0
        self.latest: Future[Any] | None = None


class ClientCallbacks:
    """Stands in for viser's thread pool; `submit` has the signature of `concurrent.futures.Executor`.

    The callbacks of a client run in the order of its messages: each begins when the one before it has ended, or has run for
    `LONG_SECONDS`. A callback of the camera, which reads the pose when it runs, is queued once however often the camera moves,
    so that a moving camera pushes no keys and clicks out of the queue. Callbacks of connection and disconnection are never
    dropped, and run on threads of their own.
    """

    def __init__(self, max_workers: int = EVENT_THREADS) -> None:
        self._events = ThreadPoolExecutor(max_workers, thread_name_prefix="callback")
        self._connections = ThreadPoolExecutor(CONNECTION_THREADS, thread_name_prefix="connection")
        self._queues: dict[tuple[str, int | None], _Queue] = {}
        self._lock = threading.Lock()

    def submit(self, call: Callable[..., Any], /, *args: Any) -> "Future[Any]":
        """Run `call(*args)` soon, in the queue of the client that the first argument belongs to.

        Returns:
            The future result. It is never done if the callback is dropped.
        """
        is_connection = bool(args) and isinstance(args[0], viser.ClientHandle)
        key = ("connection" if is_connection else "event", _client_id(args[0] if args else None))
        return self._add(key, call, args)

    def submit_for(self, client_id: int, call: Callable[..., Any], *args: Any) -> "Future[Any]":
        """The same for a callback whose arguments do not show the client."""
        return self._add(("event", client_id), call, args)

    def shutdown(self, wait: bool = True) -> None:
        """Run no further callbacks."""
        with self._lock:
            self._queues.clear()
        self._events.shutdown(wait=wait, cancel_futures=True)
        self._connections.shutdown(wait=wait)

    def _add(self, key: tuple[str, int | None], call: Callable[..., Any], args: tuple[Any, ...]) -> "Future[Any]":
        future: Future[Any] = Future()
        with self._lock:
            if key not in self._queues:
                is_event = key[0] == "event"
                self._queues[key] = _Queue(MAX_RUNNING, MAX_QUEUED) if is_event else _Queue(1, None)
            queue = self._queues[key]
            if args and isinstance(args[0], viser.CameraHandle):
                repeated = next((future for *one, future in queue.waiting if one == [call, args]), None)
                if repeated is not None:
                    return repeated
            queue.waiting.append((call, args, future))
            starts = queue.running < queue.max_running
            queue.running += starts
        if starts:
            pool = self._events if key[0] == "event" else self._connections
            pool.submit(self._drain, key, queue)
        return future

    def _drain(self, key: tuple[str, int | None], queue: _Queue) -> None:
        """Run waiting callbacks, one after another, until there are none."""
        waited_for: Future[Any] | None = None
        while True:
            with self._lock:
                if not queue.waiting:
                    queue.running -= 1
                    if not queue.running and self._queues.get(key) is queue:
                        del self._queues[key]
                    return
                before = queue.latest
                if before is None or before.done() or before is waited_for:
                    begun = queue.waiting.popleft()
                    queue.latest = begun[2]
                else:
                    begun = None
            if begun is not None:
                _run(*begun)
            elif before is not None:
                wait([before], LONG_SECONDS)
                waited_for = before


def _run(call: Callable[..., Any], args: tuple[Any, ...], future: "Future[Any]") -> None:
    try:
        result = call(*args)
    except BaseException as error:
        logging.getLogger(__name__).debug("a callback failed", exc_info=error)
        future.set_exception(error)
    else:
        future.set_result(result)


def _client_id(argument: Any) -> int | None:
    """The client of an event, a client's handle or a camera; None of something else."""
    if isinstance(argument, viser.CameraHandle):
        return argument.client.client_id
    return getattr(argument, "client_id", None)
