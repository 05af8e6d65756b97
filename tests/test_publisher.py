"""Publisher: when a state is due."""

import threading
import time
from dataclasses import dataclass

from app.debugger.publisher import INTERVAL, Publisher
from tests.waiting import wait_for


@dataclass(frozen=True)
class State:
    serial: int = 1
    work: int = 0


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
