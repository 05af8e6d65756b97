"""Race: two runs computed in turn, so that both have used about the same computing time."""

from collections.abc import Callable, Collection

from app.debugger.runs import Runs
from fairing.errors import InputError
from fairing.options import FairingOptions


def race(
    runs: Runs,
    options: tuple[FairingOptions, FairingOptions],
    start: Callable[[FairingOptions, Collection[int]], int],
    before_step: Callable[[int], bool],
) -> str:
    """Compute both runs to their ends; the second one becomes the current run. Returns why it stopped.

    Args:
        runs: a run from the start with these options takes part as it is; else one is started.
        start: starts a run with options and returns its id; the runs given stay although they have no steps yet.
        before_step: called before every step with the id of the first run; returns whether to stop.

    Raises:
        InputError: both options are the same.
    """
    if options[0] == options[1]:
        raise InputError("comparison of two runs: expected different options")
    racing: list[int] = []
    for own in options:
        run_id = runs.from_start_with(own)
        racing.append(start(own, racing) if run_id is None else run_id)
    runs.switch(racing[1])
    sessions = [runs.of(run_id) for run_id in racing]
    for session in sessions:
        session.go_to(len(session.trace))
    try:
        while behind := [session for session in sessions if not session.finished]:
            if before_step(racing[0]):
                return "paused; compare the presets again to continue"
            min(behind, key=lambda session: session.seconds["steps"]).step()
    finally:
        sessions[0].forget_computed()
    return f"both runs are finished: {sessions[0].moment} and {sessions[1].moment} steps"
