"""2,000 random commands at random times on the small corner: see `tests.monkey`."""

import pytest

from tests.monkey import MonkeyError, monkey_on, play

COMMANDS = 2000


@pytest.mark.slow
def test_random_commands_leave_no_dead_thread_no_stuck_state_and_no_inconsistent_state():
    outcome = play(monkey_on("corner"), 12, 0, COMMANDS)
    assert sum(outcome.names.values()) == COMMANDS
    assert outcome.steps > 100
    assert outcome.states > 500
    assert len(outcome.rests) > 50


def test_the_monkey_notices_a_thread_that_was_replaced(monkeypatch: pytest.MonkeyPatch):
    def end(*_: object) -> None:
        raise SystemExit

    monkeypatch.setattr("app.debugger.controller.snapshot_of", end)
    with pytest.raises((MonkeyError, SystemExit)):
        play(monkey_on("corner"), 1, 0, 5)
