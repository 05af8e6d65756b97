"""Waiting for something that another thread, process or browser does."""

import time
from collections.abc import Callable

# A busy machine may first have to compile the engine's kernels: only what never happens is a failure.
PATIENCE = 120.0  # s


def wait_for(condition: Callable[[], bool], seconds: float = PATIENCE) -> None:
    """Poll until `condition` holds. Raises AssertionError when it has not after that many seconds."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, f"the condition did not hold within {seconds:g} s"
        time.sleep(0.01)
