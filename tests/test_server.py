"""The server without a browser: who may connect, and what a client that misbehaves can do to others."""

import asyncio
import gc
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import msgspec
import pytest
import viser
from websockets.exceptions import ConnectionClosed
from websockets.frames import CloseCode

from app.debugger.commands import Extent, Forward, JumpTo, Pause
from app.page.server import App, start
from app.viser_bridge.access import token_for
from app.viser_bridge.client_callbacks import MAX_QUEUED, ClientCallbacks
from app.viser_bridge.message_event import MessageBuffer, MessageEvent
from app.viser_bridge.paced_connection import BURST, MAX_MESSAGE_BYTES
from app.viser_bridge.server import ViewerServer, check_address, start_viewer
from fairing.errors import InputError
from fairing.run.session import Session
from tests.commands import do
from tests.raw_client import CAMERA, RawClient, http_status, raw_status, upgrade_status
from tests.small_scene import corner_scene
from tests.waiting import wait_for

# A page is still being built when its client has gone.
pytestmark = pytest.mark.filterwarnings("ignore:Queued a .* on a closed connection")

SLIDER, TEXT = "GuiSliderMessage", "GuiTextMessage"


@pytest.fixture(scope="module")
def app() -> Iterator[App]:
    app = start(Session(corner_scene()), port=0)
    yield app
    app.stop()


@pytest.fixture
def guarded() -> Iterator[ViewerServer]:
    server = start_viewer("127.0.0.1", 0, token="a-long-secret")
    yield server
    server.close()


def widgets(client: RawClient) -> dict[str, str]:
    """Ids of a new page's sliders by label, and of the input that carries HTML events as "events"."""
    found: dict[str, str] = {}
    while not {"Photo – model", "events"} <= found.keys():
        for message in client.receive(60):
            if message["type"] == SLIDER:
                found[message["props"]["label"]] = message["uuid"]
            if message["type"] == TEXT and message["props"]["label"] == "events":
                found["events"] = message["uuid"]
    return found


def update(uuid: str, value: Any) -> dict[str, Any]:
    return {"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": value}}


def test_only_pages_of_this_server_may_connect(app: App):
    own = {"Host": f"127.0.0.1:{app.port}", "Origin": f"http://127.0.0.1:{app.port}"}
    assert upgrade_status(app.port, own) == 101
    for origin in ("http://evil.example", "http://127.0.0.1:9999", f"http://127.0.0.1.evil.example:{app.port}", "null"):
        assert upgrade_status(app.port, own | {"Origin": origin}) == 403, origin


def test_a_page_may_connect_through_a_forwarded_port(app: App):
    """As with `ssh -L 9000:localhost:8080`: the browser knows the page by another port."""
    assert upgrade_status(app.port, {"Host": "localhost:9000", "Origin": "http://localhost:9000"}) == 101


def test_a_foreign_name_for_this_machine_is_refused(app: App):
    """DNS rebinding: an attacker's name resolves to 127.0.0.1, so origin and host are equal."""
    name = f"evil.example:{app.port}"
    assert upgrade_status(app.port, {"Host": name, "Origin": f"http://{name}"}) == 403
    assert http_status(app.port, headers={"Host": name})[0] == 403


@pytest.mark.parametrize("is_websocket", [False, True])
@pytest.mark.parametrize("header", ["Host", "Origin", "Authorization", "Upgrade"])
def test_a_header_given_twice_is_refused(app: App, header: str, is_websocket: bool):
    name = f"127.0.0.1:{app.port}"
    given = {"Host": name, "Origin": f"http://{name}", "Authorization": "Bearer a", "Upgrade": "websocket"}
    lines = [f"Host: {name}"]
    if is_websocket:
        lines += [
            "Connection: Upgrade", "Upgrade: websocket", "Sec-WebSocket-Version: 13",
            "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==", f"Sec-WebSocket-Protocol: viser-v{viser.__version__}",
        ]  # fmt: skip
    assert raw_status(app.port, *lines) == (101 if is_websocket else 200)
    for second in (given[header], "evil.example"):
        others = [line for line in lines if not line.startswith(header)]
        assert raw_status(app.port, *others, f"{header}: {given[header]}", f"{header}: {second}") == 403


def test_a_request_without_host_is_refused(app: App):
    assert raw_status(app.port) == 403


def test_programs_on_this_machine_need_no_origin(app: App):
    with RawClient(app.port) as client:
        client.announce()
        assert "Moment" in widgets(client)


def test_without_the_token_neither_page_nor_websocket_is_served(guarded: ViewerServer):
    port = guarded.get_port()
    own = {"Origin": f"http://127.0.0.1:{port}"}
    assert http_status(port)[0] == 403
    assert http_status(port, "/?token=wrong")[0] == 403
    assert http_status(port, headers={"Cookie": f"eigenfairing-{port}=wrong"})[0] == 403
    assert http_status(port, headers={"Cookie": f"eigenfairing-{port + 1}=a-long-secret"})[0] == 403
    assert upgrade_status(port, own) == 403
    assert upgrade_status(port, own | {"Authorization": "Bearer wrong"}) == 403


def test_the_token_is_kept_in_a_cookie_and_leaves_the_address(guarded: ViewerServer):
    port = guarded.get_port()
    status, headers = http_status(port, guarded.url.partition(str(port))[2])
    assert (status, headers["Location"]) == (303, "/")
    cookie, *flags = headers["Set-Cookie"].split("; ")
    assert set(flags) == {"HttpOnly", "SameSite=Lax", "Path=/"}
    assert http_status(port, headers={"Cookie": cookie})[0] == 200
    assert upgrade_status(port, {"Origin": f"http://127.0.0.1:{port}", "Cookie": cookie}) == 101
    assert upgrade_status(port, {"Origin": "http://127.0.0.1:9999", "Cookie": cookie}) == 403
    assert upgrade_status(port, {"Authorization": "Bearer a-long-secret"}) == 101


def test_a_token_is_made_where_other_machines_can_connect():
    assert token_for("127.0.0.1", None) is None
    assert token_for("::1", None) is None
    assert token_for("localhost", None) is None
    assert token_for("127.0.0.1", "chosen-by-me") == "chosen-by-me"
    for token in ("", "short", "with a blank", "semi;colon"):
        with pytest.raises(InputError, match="token: use at least 8"):
            token_for("127.0.0.1", token)
    first, second = token_for("0.0.0.0", None), token_for("192.168.1.7", None)
    assert first is not None
    assert len(first) >= 32
    assert first != second
    server = start_viewer("0.0.0.0", 0)
    try:
        assert f"?token={server.access.token}" in server.url
        assert server.url_for_others is not None
        assert server.url_for_others.startswith(f"http://{socket.gethostname()}:")
        assert http_status(server.get_port())[0] == 403
    finally:
        server.close()


def test_a_busy_port_and_an_unknown_host_are_errors(app: App):
    with pytest.raises(InputError, match=f"port {app.port} .*already in use"):
        start_viewer("127.0.0.1", app.port)
    with pytest.raises(InputError, match=r"host 203\.0\.113\.7"):
        start_viewer("203.0.113.7", 0)
    with pytest.raises(InputError, match=r"host no\.such\.host\.invalid"):
        check_address("no.such.host.invalid", 0)
    with pytest.raises(InputError, match="port 70000"):
        check_address("127.0.0.1", 70000)


@pytest.mark.slow
def test_a_flood_of_messages_from_one_client_delays_nobody_else(app: App):
    with RawClient(app.port) as flooding, RawClient(app.port) as other:
        flooding.announce()
        events = widgets(flooding)["events"]
        quiet = time_of_a_new_page(app)
        for k in range(2500):  # every HTML event of the page in turn: cameras, jumps, branches, nonsense
            flooding.send(update(events, f"[{k + 1},{k % 90},{k % 7}]"))
        began = time.monotonic()
        other.announce()
        widgets(other)
        waited = time.monotonic() - began
        assert waited < 5 * quiet + 5, f"a new page took {waited:.1f} s, {quiet:.1f} s without the flood"
    app.controller.post(Pause())


def time_of_a_new_page(app: App) -> float:
    began = time.monotonic()
    with RawClient(app.port) as client:
        client.announce()
        widgets(client)
    return time.monotonic() - began


def test_the_last_of_many_messages_takes_effect(app: App):
    """A flood is slowed down, and what is dropped is older than what is kept."""
    with RawClient(app.port) as client:
        client.announce()
        slider = widgets(client)["Magnify paths"]
        known = set(app.pages)
        wait_for(lambda: len(app.pages) > 0)
        for k in range(BURST + 50):
            client.send(update(slider, 2 + k % 40))
        client.send(update(slider, 50))
        wait_for(lambda: any(page.page_state.magnification == 50 for page in app.pages.values()), 60)
        assert known <= set(app.pages) or not known


MALFORMED = {
    "no msgpack": b"\xc1\xff\x00",
    "empty": b"",
    "a number": b"\x07",
    "no type": msgspec.msgpack.encode({"a": 1}),
    "unknown type": msgspec.msgpack.encode({"type": "NoSuchMessage"}),
    "type of another kind": msgspec.msgpack.encode({"type": [1]}),
    "missing fields": msgspec.msgpack.encode({"type": "GuiUpdateMessage"}),
    "surplus fields": msgspec.msgpack.encode(CAMERA | {"more": 1}),
    "text": "hello",
    "deeply nested": b"\x91" * 100_000 + b"\x01",
}


@pytest.mark.parametrize("case", MALFORMED)
def test_a_malformed_message_is_one_line_and_ends_its_connection(
    app: App, case: str, caplog: pytest.LogCaptureFixture, capfd: pytest.CaptureFixture[str]
):
    with RawClient(app.port) as client:
        client.socket.send(MALFORMED[case])
        with pytest.raises(ConnectionClosed) as closed:
            client.wait_for(lambda message: False, 30)
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == CloseCode.INVALID_DATA
    (record,) = [record for record in caplog.records if record.levelname in ("WARNING", "ERROR")]
    assert record.exc_info is None
    assert "closed after a malformed message" in record.getMessage()
    assert "\n" not in record.getMessage()
    assert "Traceback" not in "".join(capfd.readouterr())
    with RawClient(app.port) as other:  # the server goes on
        other.announce()
        other.receive(30)


@pytest.mark.parametrize(
    "wrong",
    [
        {"type": "GuiUpdateMessage", "uuid": 5, "updates": 7},
        {"type": "GuiUpdateMessage", "uuid": "no such element", "updates": {"value": 1}},
        CAMERA | {"position": "nowhere", "wxyz": None},
    ],
)
def test_a_message_with_wrong_values_leaves_no_traceback(
    app: App, wrong: dict[str, Any], caplog: pytest.LogCaptureFixture, capfd: pytest.CaptureFixture[str]
):
    with RawClient(app.port) as client:
        client.announce()
        widgets(client)
        client.send(wrong)
        with suppress(ConnectionClosed):  # the server may have closed it by then
            client.send(wrong)
            client.announce()
        time.sleep(0.5)
    with RawClient(app.port) as other:
        other.announce()
        other.receive(30)
    gc.collect()  # asyncio reports errors of tasks when they are freed
    assert all(record.exc_info is None for record in caplog.records if record.levelname in ("WARNING", "ERROR"))
    assert "Traceback" not in "".join(capfd.readouterr())


def test_requests_that_are_not_http_leave_nothing_in_the_terminal(
    caplog: pytest.LogCaptureFixture, capfd: pytest.CaptureFixture[str]
):
    server = start_viewer("127.0.0.1", 0)
    for content in (b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03", b"hello\r\n\r\n", b"GET / HTTP/9\r\n\r\n", b""):
        with socket.create_connection(("127.0.0.1", server.get_port()), timeout=30) as connection:
            connection.sendall(content)
            connection.shutdown(socket.SHUT_WR)
            connection.recv(1000)
    assert http_status(server.get_port())[0] == 200
    server.close()
    assert [record for record in caplog.records if record.levelname in ("WARNING", "ERROR")] == []
    assert "Traceback" not in "".join(capfd.readouterr())


def test_a_client_that_sends_a_huge_message_is_disconnected(app: App):
    with RawClient(app.port) as client:
        client.announce()
        slider = widgets(client)["Moment"]
        client.send(update(slider, "x" * (MAX_MESSAGE_BYTES + 1)))
        with pytest.raises(ConnectionClosed) as closed:
            client.wait_for(lambda _: False)
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == CloseCode.MESSAGE_TOO_BIG


def test_a_client_that_reads_nothing_delays_nobody(app: App):
    """It is sent many states, and another page still follows them at once."""
    with RawClient(app.port) as stalled, RawClient(app.port) as other:
        stalled.announce()
        widgets(stalled)
        other.announce()
        slider = widgets(other)["Moment"]
        for _ in range(200):
            app.controller.republish()
        state = do(app.controller, JumpTo(0), Forward(Extent.ITERATION))
        began = time.monotonic()
        other.wait_for(lambda message: is_update(message, slider, state.moment))
        assert time.monotonic() - began < 30
        do(app.controller, JumpTo(0))


def is_update(message: dict[str, Any], uuid: str, value: Any) -> bool:
    return (
        message["type"] == "GuiUpdateMessage" and message["uuid"] == uuid and message["updates"].get("value") == value
    )


def test_connections_that_come_and_go_leave_no_pages(app: App):
    for _ in range(5):
        with RawClient(app.port) as client:
            client.announce()
    wait_for(lambda: not app.pages, 60)


class _Event:
    def __init__(self, client_id: int) -> None:
        self.client_id = client_id


def test_the_queue_of_one_client_is_bounded_and_drops_the_oldest():
    callbacks, release, done, begun = ClientCallbacks(), threading.Event(), [], []

    def block(event: _Event) -> None:
        begun.append(event)
        release.wait(60)

    try:
        for _ in range(2):
            callbacks.submit(block, _Event(1))
        wait_for(lambda: len(begun) == 2, 60)
        for k in range(10 * MAX_QUEUED):
            callbacks.submit(lambda event, k=k: done.append(k), _Event(1))
        callbacks.submit(lambda event: done.append("other"), _Event(2))
        wait_for(lambda: done == ["other"], 60)
        release.set()
        wait_for(lambda: len(done) == MAX_QUEUED + 1, 60)
        assert sorted(done[1:]) == list(range(9 * MAX_QUEUED, 10 * MAX_QUEUED))
        wait_for(lambda: not callbacks._queues, 60)
    finally:
        release.set()
        callbacks.shutdown(wait=False)


def test_a_camera_that_moves_pushes_no_key_out_of_the_queue():
    callbacks, release, done, begun = ClientCallbacks(), threading.Event(), [], []
    client = object.__new__(viser.ClientHandle)
    client.client_id = 1
    camera = viser.CameraHandle(client)

    def block(event: _Event) -> None:
        begun.append(event)
        release.wait(60)

    def moved(_: viser.CameraHandle) -> None:
        done.append("camera")

    try:
        for _ in range(2):
            callbacks.submit(block, _Event(1))
        wait_for(lambda: len(begun) == 2, 60)
        callbacks.submit(lambda event: done.append("key"), _Event(1))
        for _ in range(10 * MAX_QUEUED):
            callbacks.submit(moved, camera)
        release.set()
        wait_for(lambda: not callbacks._queues, 60)
        assert done == ["key", "camera"]
    finally:
        release.set()
        callbacks.shutdown(wait=False)


def test_the_callbacks_of_one_client_run_in_their_order(monkeypatch: pytest.MonkeyPatch):
    """Else the first of two widths of the view could be the one that lasts."""
    monkeypatch.setattr("app.viser_bridge.client_callbacks.LONG_SECONDS", 60.0)  # also on a machine that is busy
    callbacks, done = ClientCallbacks(), []

    def slower_first(event: _Event, k: int) -> None:
        time.sleep(0.02 if k % 2 == 0 else 0)
        done.append(k)

    try:
        for k in range(40):
            callbacks.submit(lambda event, k=k: slower_first(event, k), _Event(1))
        wait_for(lambda: len(done) == 40, 60)
        assert done == sorted(done)
    finally:
        callbacks.shutdown(wait=False)


def test_a_long_callback_does_not_block_the_next_ones_of_its_client():
    callbacks, release, done = ClientCallbacks(), threading.Event(), []
    try:
        callbacks.submit(lambda event: release.wait(60), _Event(1))
        for k in range(20):
            callbacks.submit(lambda event, k=k: done.append(k), _Event(1))
        wait_for(lambda: len(done) == 20, 30)
        assert done == sorted(done)
    finally:
        release.set()
        callbacks.shutdown(wait=False)


def test_connection_callbacks_are_never_dropped_and_keep_their_order(app: App):
    callbacks, done = ClientCallbacks(), []
    client = object.__new__(viser.ClientHandle)
    client.client_id = 7
    try:
        for k in range(10 * MAX_QUEUED):
            callbacks.submit(lambda client, k=k: done.append(k), client)
        wait_for(lambda: len(done) == 10 * MAX_QUEUED, 60)
        assert done == sorted(done)
    finally:
        callbacks.shutdown(wait=False)


def test_a_callback_that_raises_keeps_the_queue_running():
    callbacks, done = ClientCallbacks(), []
    try:
        failing = [callbacks.submit(lambda event: 1 / 0, _Event(1)) for _ in range(4)]
        callbacks.submit(lambda event: done.append(1), _Event(1))
        wait_for(lambda: done == [1], 60)
        assert all(isinstance(future.exception(60), ZeroDivisionError) for future in failing)
    finally:
        callbacks.shutdown(wait=False)


def test_only_the_event_loop_wakes_those_who_wait_for_messages():
    async def waits() -> list[bool]:
        event, woken = MessageEvent(), []
        waiter = asyncio.create_task(event.wait())
        await asyncio.sleep(0)
        other = threading.Thread(target=event.set)
        other.start()
        other.join()
        await asyncio.sleep(0)
        woken.append(event.is_set() or waiter.done())
        asyncio.get_running_loop().call_soon_threadsafe(event.set)
        woken.append(await asyncio.wait_for(waiter, 60))
        return woken

    assert asyncio.run(waits()) == [False, True]


def test_every_message_that_threads_push_at_once_arrives():
    server = start_viewer("127.0.0.1", 0)
    texts = [server.gui.add_html("") for _ in range(8)]

    def write(k: int) -> None:
        for n in range(300):
            texts[k].content = f"text {k}: {n}"

    try:
        with RawClient(server.get_port()) as client:
            buffer = server.gui._websock_interface.get_message_buffer()
            assert isinstance(buffer, MessageBuffer)
            assert isinstance(buffer.message_event, MessageEvent)
            threads = [threading.Thread(target=write, args=(k,)) for k in range(len(texts))]
            for thread in threads:
                thread.start()
            missing = {f"text {k}: 299" for k in range(len(texts))}
            while missing:
                received = str(client.receive(60))
                missing = {text for text in missing if text not in received}
            for thread in threads:
                thread.join()
    finally:
        server.close()
