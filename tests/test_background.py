"""Worker threads, background computations and their cache."""

import threading
import time

import pytest

from app.background_worker import BackgroundWorker
from app.query_cache import QueryCache
from app.worker_thread import WorkerThread


class ManualSubmit:
    """A `Submit` that runs a computation when the test says so."""

    def __init__(self) -> None:
        self.submitted = []

    def __call__(self, key, compute, callback) -> None:
        self.submitted.append((compute, callback))

    def run(self, n: int) -> None:
        compute, callback = self.submitted[n]
        callback(compute())


class Numbers:
    """A worker thread that handles the numbers of a list."""

    def __init__(self, handle) -> None:
        self.changed, self.waiting = threading.Condition(), []
        take = lambda: self.waiting.pop(0) if self.waiting else None  # noqa: E731
        self.worker: WorkerThread[int] = WorkerThread("numbers", self.changed, take, handle)
        self.worker.start()

    def add(self, *numbers: int) -> None:
        with self.changed:
            self.waiting += numbers
            self.changed.notify_all()


def test_a_newer_job_replaces_one_that_has_not_begun():
    gate, done, results = threading.Event(), threading.Semaphore(0), []
    worker = BackgroundWorker(done.release)
    worker.post("a", gate.wait, lambda _: None)
    for n in range(3):
        worker.post("b", lambda n=n: n, results.append)
    worker.post("c", lambda: "c", results.append)
    worker.post("d", lambda: "d", results.append)
    worker.cancel("d")
    gate.set()
    for _ in range(3):
        assert done.acquire(timeout=300)
    worker.close()
    assert results == [2, "c"]


def test_an_exception_of_a_job_is_its_result_and_the_next_job_runs():
    done, results = threading.Semaphore(0), []
    worker = BackgroundWorker(done.release)
    worker.post("a", lambda: 1 / 0, results.append)
    worker.post("b", lambda: 1, results.append)
    for _ in range(2):
        assert done.acquire(timeout=300)
    worker.close()
    assert isinstance(results[0], ZeroDivisionError)
    assert results[1] == 1


def test_an_exception_of_a_callback_does_not_end_the_worker():
    results, done = [], threading.Event()
    worker = BackgroundWorker()
    worker.post("a", lambda: 1, lambda _: 1 / 0)
    worker.post("b", lambda: 2, lambda found: (results.append(found), done.set()))
    assert done.wait(60)
    worker.close()
    assert results == [2]


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_worker_whose_thread_has_ended_starts_anew_with_the_next_job():
    def end() -> None:
        raise SystemExit

    results, done = [], threading.Event()
    worker = BackgroundWorker()
    worker.post("a", end, results.append)
    wait_for(lambda: worker._thread.is_dead)
    worker.post("b", lambda: 2, lambda found: (results.append(found), done.set()))
    assert done.wait(60)
    worker.close()
    assert results == [2]


def test_a_worker_thread_survives_exceptions_and_handles_every_item_in_order():
    handled, done = [], threading.Event()

    def handle(number: int) -> None:
        handled.append(number)
        if number == 1:
            raise ValueError("one")
        if number == 4:
            done.set()

    numbers = Numbers(handle)
    numbers.add(1, 2)
    numbers.add(3, 4)
    assert done.wait(60)
    numbers.worker.close(10)
    assert handled == [1, 2, 3, 4]
    assert not numbers.worker.is_alive
    assert not numbers.worker.is_dead, "closed, not dead"


def test_a_dead_worker_thread_has_its_traceback_and_can_be_restarted():
    handled, done = [], threading.Event()

    def handle(number: int) -> None:
        if number == 1:
            raise SystemExit("one")
        handled.append(number)
        done.set()

    numbers = Numbers(handle)
    numbers.add(1, 2)
    wait_for(lambda: numbers.worker.is_dead)
    assert "SystemExit: one" in numbers.worker.failure
    numbers.worker.restart()
    assert done.wait(60)
    numbers.worker.close(10)
    assert handled == [2]


def test_a_replaced_worker_thread_takes_no_further_item():
    gate, handled, threads, done = threading.Event(), [], set(), threading.Event()

    def handle(number: int) -> None:
        threads.add(threading.current_thread())
        if number == 1:
            gate.wait(60)
        handled.append(number)
        if len(handled) == 3:
            done.set()

    numbers = Numbers(handle)
    numbers.add(1)
    wait_for(lambda: numbers.worker.busy_seconds > 0.05)
    assert "gate.wait" in numbers.worker.stack()
    numbers.worker.restart()
    numbers.add(2)
    wait_for(lambda: handled == [2])
    gate.set()
    numbers.add(3)
    assert done.wait(60)
    numbers.worker.close(10)
    assert sorted(handled) == [1, 2, 3]
    assert len(threads) == 2
    (old,) = threads - {numbers.worker._thread}
    old.join(10)
    assert not old.is_alive()


def test_a_query_cache_computes_once_for_each_key_and_keeps_the_latest_result():
    submit = ManualSubmit()
    cache: QueryCache[str, str] = QueryCache(submit)
    for key in ("one", "one", "two"):
        cache.request(key, lambda key=key: key.upper())
    assert len(submit.submitted) == 2
    assert cache.latest is None
    submit.run(1)
    assert cache.latest == ("two", "TWO")
    submit.run(0)  # late
    assert cache.latest == ("two", "TWO")
    assert cache.result_for("two") == "TWO"
    assert cache.result_for("one") is None
    cache.clear()
    assert cache.latest is None
    cache.request("two", lambda: "again")
    assert len(submit.submitted) == 3


def wait_for(condition, seconds: float = 60.0) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "timed out"
        time.sleep(0.005)
