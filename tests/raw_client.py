"""A websocket client without a browser: connects to a page's server, reads its messages and sends messages of its own."""

import http.client
import socket
from collections.abc import Callable
from typing import Any

import msgspec
import viser
import zstandard
from websockets.sync.client import ClientConnection, connect

CAMERA: dict[str, Any] = {
    "type": "ViewerCameraMessage", "wxyz": (1.0, 0.0, 0.0, 0.0), "position": (3.0, 3.0, 3.0), "fov": 0.9, "near": 0.01,
    "far": 1000.0, "look_at": (0.0, 0.0, 0.0), "up_direction": (0.0, 0.0, 1.0), "image_height": 600, "image_width": 800,
}  # fmt: skip


class RawClient:
    """One connection. The server builds its page after the first camera message, as it does for a browser."""

    def __init__(self, port: int, *, origin: str | None = None, headers: dict[str, str] | None = None) -> None:
        self.socket: ClientConnection = connect(
            f"ws://127.0.0.1:{port}/", subprotocols=[f"viser-v{viser.__version__}"], origin=origin,
            additional_headers=headers, max_size=None, compression=None, open_timeout=60, ping_interval=None,
        )  # fmt: skip
        self._unpack = zstandard.ZstdDecompressor()

    def __enter__(self) -> "RawClient":
        return self

    def __exit__(self, *_: object) -> None:
        self.socket.close()

    def send(self, message: dict[str, Any]) -> None:
        self.socket.send(msgspec.msgpack.encode(message))

    def announce(self) -> None:
        """Send the first camera message."""
        self.send(CAMERA)

    def receive(self, timeout: float) -> list[dict[str, Any]]:
        """The messages of one frame.

        Raises:
            TimeoutError: none came in `timeout` seconds.
        """
        frame = self.socket.recv(timeout)
        assert isinstance(frame, bytes)
        size = int.from_bytes(frame[8:16], "little")
        return list(msgspec.msgpack.decode(self._unpack.decompress(frame[16 : 16 + size]))["messages"])

    def wait_for(self, fits: Callable[[dict[str, Any]], bool], timeout: float = 60.0) -> dict[str, Any]:
        """The next message that fits; messages before it are dropped."""
        while True:
            for message in self.receive(timeout):
                if fits(message):
                    return message


def http_status(port: int, path: str = "/", headers: dict[str, str] | None = None) -> tuple[int, dict[str, str]]:
    """Status and headers of the answer to a GET request."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=60)
    connection.request("GET", path, headers=headers or {})
    answer = connection.getresponse()
    answer.read()
    connection.close()
    return answer.status, dict(answer.getheaders())


def raw_status(port: int, *lines: str) -> int:
    """Status of the answer to a GET request with exactly these header lines; 0 for none."""
    with socket.create_connection(("127.0.0.1", port), timeout=60) as connection:
        connection.sendall("\r\n".join(("GET / HTTP/1.1", *lines, "", "")).encode("latin-1"))
        answer = connection.makefile("rb").readline().split()
    return int(answer[1]) if len(answer) > 1 else 0


def upgrade_status(port: int, headers: dict[str, str]) -> int:
    """Status of the answer to a websocket request with these headers."""
    standard = {
        "Connection": "Upgrade", "Upgrade": "websocket", "Sec-WebSocket-Version": "13",
        "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==", "Sec-WebSocket-Protocol": f"viser-v{viser.__version__}",
    }  # fmt: skip
    return http_status(port, "/", standard | headers)[0]
