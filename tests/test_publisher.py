"""Publisher: when a state is due, and that none is lost."""

import threading
import time
from dataclasses import dataclass

from app.debugger.publisher import INTERVAL, Publisher
from tests.waiting import wait_for


@dataclass(frozen=True)
class State:
    serial: int = 1
    work: int = 0
    log: int = 0


def test_what_is_polled_does_not_hold_back_the_state_after_a_step():
    polled = {"work": 0}
    publisher = Publisher(threading.Condition(), State(), lambda: polled, lambda error: None)  # pyright: ignore[reportArgumentType]
    publisher.update()
    time.sleep(2 * INTERVAL)
    publisher.worker.start()
    polled["work"] = 1
    publisher.republish()
    wait_for(lambda: publisher.state.work == 1)
    assert publisher.is_due
    publisher.worker.close(5.0)


def test_a_state_that_was_not_due_is_delivered_without_another_update():
    publisher = Publisher(threading.Condition(), State(), dict, lambda error: None)  # pyright: ignore[reportArgumentType]
    seen: list[int] = []
    publisher.subscribe(lambda state: seen.append(state.work))  # pyright: ignore[reportAttributeAccessIssue]
    publisher.worker.start()
    publisher.update(work=1)
    publisher.update_when_due(work=2)
    assert publisher.state.work == 1  # pyright: ignore[reportAttributeAccessIssue]
    wait_for(lambda: seen[-1:] == [2])
    publisher.update(work=3)
    publisher.update_when_due(work=4)
    publisher.update(log=1)
    wait_for(lambda: seen[-1:] == [4])
    publisher.update(work=5)
    publisher.update_when_due(work=6)
    publisher.update(work=7)
    time.sleep(4 * INTERVAL)
    assert publisher.state.work == 7  # pyright: ignore[reportAttributeAccessIssue]
    publisher.worker.close(5.0)
