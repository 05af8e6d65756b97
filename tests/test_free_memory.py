"""Freed memory is returned to the operating system: while the engine rests, seldom, and after a page has gone."""

import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.debugger.controller import Controller
from app.debugger.run_state import Activity
from app.page import free_memory
from app.page.free_memory import FreeMemory, return_free_memory
from fairing.run.session import Session
from tests.small_scene import corner_scene, small_options
from tests.waiting import wait_for

BLOCK = 100_000  # bytes: below glibc's threshold, so that it comes from the heap of its thread
COUNT = 1000


def resident() -> int:
    """Bytes."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096


@pytest.mark.skipif(sys.platform != "linux", reason="glibc alone keeps a heap for each thread")
def test_blocks_between_others_are_returned():
    """Freed by several threads, and with a block at the end of each heap that is still used."""
    kept: list[np.ndarray] = []

    def use() -> None:
        blocks = [np.ones(BLOCK, dtype=np.uint8) for _ in range(COUNT)]
        kept.append(blocks[-1])

    for _ in range(3):
        thread = threading.Thread(target=use)
        thread.start()
        thread.join()
    before = resident()
    return_free_memory()
    assert before - resident() > 0.5 * BLOCK * COUNT


def test_memory_is_returned_at_rest_and_seldom(monkeypatch: pytest.MonkeyPatch):
    returned: list[float] = []
    monkeypatch.setattr(free_memory, "return_free_memory", lambda: returned.append(time.monotonic()))
    monkeypatch.setattr(free_memory, "REST_SECONDS", 0.2)
    controller = Controller(Session(corner_scene(), small_options()))
    memory = FreeMemory()
    try:
        resting = controller.state
        memory.follow(resting)
        time.sleep(0.25)
        memory.follow(replace(resting, activity=Activity.RUNNING))
        time.sleep(0.05)
        assert returned == []
        for _ in range(50):
            memory.follow(resting)
        wait_for(lambda: len(returned) == 1)
        time.sleep(0.05)
        assert len(returned) == 1
    finally:
        memory.close()
        controller.close()
