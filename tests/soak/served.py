"""The served process: the debugger on the demo cube, until standard input ends. Prints its address.

Old runs are deleted and long ones restarted, as users do; a record grows by design.
"""

import logging
import sys
import threading

from app.debugger.commands import DeleteRun, Pause, Restart
from app.debugger.controller import Controller
from app.page.server import start
from demo_scenes import load_demo
from fairing.options import PRESETS
from fairing.run.session import Session
from tests.waiting import wait_for

MOST_RUNS = 4
MOST_STEPS = 400
PERIOD = 0.5  # s between two checks


def tidy(controller: Controller) -> None:
    """Delete the oldest run of too many, and restart a run that is too long."""
    state = controller.state
    if len(state.runs) > MOST_RUNS:
        controller.post(Pause())
        controller.post(DeleteRun(next(run.run_id for run in state.runs if run.run_id != state.run_id)))
    if state.length > MOST_STEPS:
        controller.post(Pause())
        wait_for(lambda: not controller.state.is_moving)
        controller.post(Restart(None))


def main() -> None:
    logging.basicConfig(level=logging.WARNING)
    app = start(Session(load_demo("cube"), PRESETS["paper"]), port=0)
    print(app.url, flush=True)
    ended = threading.Event()
    threading.Thread(target=lambda: (sys.stdin.read(), ended.set()), name="stdin", daemon=True).start()
    while not ended.wait(PERIOD):
        tidy(app.controller)
    app.stop()


if __name__ == "__main__":
    main()
