"""Commands to a controller, one after another."""

from app.debugger.controller import Controller
from app.debugger.run_state import RunState


def do(controller: Controller, *commands) -> RunState:
    """Post each command when the one before is done; the state after the last."""
    for command in commands:
        controller.post(command)
        controller.wait_until_idle()
    return controller.state
