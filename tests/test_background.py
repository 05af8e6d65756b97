"""Work away from the engine: the newest question of each asker is answered, trouble stays with who caused it."""

import threading

from app.background_worker import Background
from app.query_cache import QueryCache


class Collector:
    """A `Send` that answers when told to."""

    def __init__(self) -> None:
        self.asked = []

    def __call__(self, asker, work, answer) -> None:
        self.asked.append((work, answer))

    def answer(self, n: int) -> None:
        work, answer = self.asked[n]
        answer(work())


def test_a_newer_job_replaces_one_that_has_not_begun():
    gate, done, answers = threading.Event(), threading.Semaphore(0), []
    background = Background(done.release)
    background.post("a", gate.wait, lambda _: None)
    for n in range(3):
        background.post("b", lambda n=n: n, answers.append)
    background.post("c", lambda: "c", answers.append)
    gate.set()
    for _ in range(3):
        assert done.acquire(timeout=300)
    background.close()
    assert answers == [2, "c"]


def test_what_a_job_raises_is_its_answer_and_the_next_one_is_done():
    done, answers = threading.Semaphore(0), []
    background = Background(done.release)
    background.post("a", lambda: 1 / 0, answers.append)
    background.post("b", lambda: 1, answers.append)
    for _ in range(2):
        assert done.acquire(timeout=300)
    background.close()
    assert isinstance(answers[0], ZeroDivisionError)
    assert answers[1] == 1


def test_a_lookup_asks_once_for_each_key_and_keeps_the_newest_answer():
    send = Collector()
    lookup: QueryCache[str, str] = QueryCache(send)
    for key in ("one", "one", "two"):
        lookup.want(key, lambda key=key: key.upper())
    assert len(send.asked) == 2
    assert lookup.newest is None
    send.answer(1)
    assert lookup.newest == ("two", "TWO")
    send.answer(0)  # late
    assert lookup.newest == ("two", "TWO")
    assert lookup.found("two") == "TWO"
    assert lookup.found("one") is None
