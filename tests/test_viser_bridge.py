"""The room of viser's workarounds: nothing else uses viser's private names, and values from browsers are checked."""

import re
from contextlib import nullcontext
from copy import copy
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import viser

from app.viser_bridge import __doc__ as ROOM  # noqa: N812
from app.viser_bridge.camera_pose import CameraPose, set_camera_pose
from app.viser_bridge.error_toasts import TOAST_SECONDS, ErrorToasts, NothingToDo
from app.viser_bridge.html_events import Events, choice_of, integer, line_of_text, press, whole_number
from fairing.errors import InputError

APP = Path(__file__).parents[1] / "app"
PRIVATE = re.compile(r"viser\._|\b_impl\b|_websock|_gui_api|_websocket_interface|run_in_page|_thread_executor")
NONSENSE = [None, "17", float("nan"), float("inf"), 1e308, True, {"a": 1}, [1], 2.5, -1, 4]


def test_only_this_room_uses_private_names_of_viser():
    for path in sorted(APP.rglob("*.py")):
        if path.parent.name != "viser_bridge":
            found = PRIVATE.search(path.read_text(encoding="utf-8"))
            assert found is None, f"{path}: {found}"


def test_the_workarounds_were_audited_for_the_installed_version_of_viser():
    assert f"viser {viser.__version__} " in ROOM.splitlines()[0]


def test_every_module_of_the_room_is_in_its_list():
    for path in (APP / "viser_bridge").glob("*.py"):
        assert path.stem == "__init__" or f"`{path.stem}`" in ROOM, path.stem


@pytest.mark.parametrize("value", NONSENSE)
def test_values_that_make_no_sense_are_refused(value):
    called: list[object] = []
    for handler in (integer(called.append, "number", 0, 3), choice_of(called.append, lambda: "abcd", "letter")):
        with pytest.raises(InputError, match=r"number|letter"):
            handler(value)
    assert called == []


def test_handlers_are_called_with_the_checked_value():
    called: list[object] = []
    integer(called.append, "number", 0, 3)(2.0)
    choice_of(called.append, lambda: ["x", "y"], "letter")(1)
    press(lambda: called.append("pressed"))({"anything": 1})
    line_of_text(lambda text, flag: called.append((text, flag)))(["a line", True])
    assert called == [2, "y", "pressed", ("a line", True)]
    assert isinstance(called[0], int)


@pytest.mark.parametrize(
    "value", [None, "text", ["text"], ["text", 1], [1, True], ["text", True, 3], ["x" * 1001, True]]
)
def test_text_that_is_none_or_too_long_is_refused(value):
    with pytest.raises(InputError, match="text: expected"):
        line_of_text(lambda text, flag: None)(value)


def test_the_error_names_the_value_and_its_limits():
    with pytest.raises(InputError, match="moment: expected a whole number from 0 to 7, found 9"):
        whole_number(9, 0, 7, "moment")


def test_named_events_are_javascript_calls_and_unknown_names_are_errors():
    events = Events({"play": 4, "go": 5})
    assert (events("play"), events("go", 3), events("go", "m")) == ("ef(4)", "ef(5,3)", "ef(5,m)")
    with pytest.raises(KeyError):
        events("missing")


class _Toast:
    def __init__(self, seconds: float) -> None:
        self.auto_close_seconds, self.seconds_shown = seconds, [seconds]

    def _show(self) -> None:
        self.seconds_shown.append(self.auto_close_seconds)


class _Client:
    def __init__(self) -> None:
        self.shown: list[tuple[str, str]] = []
        self.toasts: list[_Toast] = []

    def add_notification(self, title: str, body: str, *, auto_close_seconds: float, color: str) -> _Toast:
        self.shown.append((body, color))
        self.toasts.append(_Toast(auto_close_seconds))
        return self.toasts[-1]


def test_exceptions_become_toasts_and_one_that_is_there_is_renewed(monkeypatch: pytest.MonkeyPatch):
    client, now = _Client(), [100.0]
    monkeypatch.setattr("app.viser_bridge.error_toasts.time.monotonic", lambda: now[0])
    toasts = ErrorToasts(client)  # pyright: ignore[reportArgumentType]

    def fail(problem: str) -> None:
        raise InputError(problem)

    for problem in ("one", "two", "one", "one"):
        toasts(fail)(problem)
        now[0] += 2.0
    toasts.without_event(lambda: 1 / 0)("an event")
    assert client.shown == [("one", "red"), ("two", "red"), ("ZeroDivisionError: division by zero", "red")]
    seconds = client.toasts[0].seconds_shown
    assert len(seconds) == 3
    assert (np.diff(seconds) != 0).all(), "the page keeps its timer where the duration stays"
    now[0] += TOAST_SECONDS
    toasts(fail)("one")
    assert client.shown[-1] == ("one", "red")
    assert len(client.shown) == 4


def test_a_request_with_nothing_to_act_on_is_no_error():
    client = _Client()

    def fail() -> None:
        raise NothingToDo("the run has finished")

    ErrorToasts(client).without_event(fail)()  # pyright: ignore[reportArgumentType]
    assert client.shown == [("the run has finished", "gray")]


@pytest.mark.parametrize("report_after", range(1, 9))
def test_a_pose_arrives_also_when_the_browser_reports_it_while_it_is_sent(report_after: int):
    """As when a key that was pressed before has just moved the camera there."""
    pose = CameraPose(np.array([1.0, 2, 3]), np.array([0.0, 0, 1]), np.array([0.0, 0, 1]), 0.9)
    sent: list[Any] = []

    def queue_message(message: Any) -> None:
        sent.append(message)
        if len(sent) == report_after:
            client.camera._state = report

    client: Any = SimpleNamespace(atomic=nullcontext, _websock_connection=SimpleNamespace(queue_message=queue_message))
    client.camera = viser.CameraHandle(client)
    state = client.camera._state
    state.position, state.look_at, state.up_direction, state.fov = pose.position, pose.target, pose.up, pose.fov
    state.update_timestamp = 1.0
    report = copy(state)
    set_camera_pose(client, pose)
    last = {type(message).__name__: message for message in sent}
    assert np.allclose(last["SetCameraPositionMessage"].position, pose.position)
    assert np.allclose(last["SetCameraLookAtMessage"].look_at, pose.target)
    assert np.allclose(last["SetCameraUpDirectionMessage"].position, pose.up)
    assert last["SetCameraFovMessage"].fov == pose.fov
