"""What keeps strangers out: only this machine's own pages may connect, nothing is published, a busy port is said.

viser 1.1.1 offers none of this, so it is done on its private parts; tests hold every point.
"""

import contextlib
import io
import re
import socket
from collections.abc import Iterator
from typing import Any
from unittest import mock

import viser
import websockets.asyncio.server
from viser import _messages

from fairing.errors import InputError


def check_address(host: str, port: int) -> None:
    """viser takes the next free port silently, and hangs on a host that does not exist.

    Raises:
        InputError: the host is none of this machine's addresses, or the port is taken or not allowed.
    """
    if not 0 <= port <= 65535:
        raise InputError(f"port {port}: expected 0 to 65535")
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind, protocol) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address)
    except socket.gaierror:
        raise InputError(f"host {host}: is not known; use 127.0.0.1 or an address of this machine") from None
    except PermissionError:
        raise InputError(f"port {port}: not allowed; choose one above 1023 with --port") from None
    except OSError as error:
        if error.errno == 99:
            raise InputError(f"host {host}: is no address of this machine; use 127.0.0.1") from None
        raise InputError(f"port {port} on {host}: already in use; choose another with --port") from None


def start_server(host: str, port: int) -> viser.ViserServer:
    """A viser server that talks only to pages it has served itself.

    Raises:
        InputError: see `check_address`.
    """
    check_address(host, port)
    # viser greets on standard output even when told not to; the address is printed by who serves.
    with _only_origins(_own_pages(host)), contextlib.redirect_stdout(io.StringIO()):
        server = viser.ViserServer(host=host, port=port, verbose=False)
    for request in (_messages.ShareUrlRequest, _messages.ShareUrlDisconnect):
        server._websock_server.unregister_handler(request)
    if port != 0 and server.get_port() != port:
        server.stop()
        raise InputError(f"port {port} on {host}: already in use; choose another with --port")
    return server


def _own_pages(host: str) -> re.Pattern[str]:
    names = {"127.0.0.1", "localhost", r"\[::1\]", re.escape(host)}
    return re.compile(rf"http://({'|'.join(sorted(names))})(:\d+)?")


@contextlib.contextmanager
def _only_origins(pattern: re.Pattern[str]) -> Iterator[None]:
    """While this lasts, websocket servers are started with an origin filter; programs without an origin may connect."""
    original = websockets.asyncio.server.serve

    def serve(*args: Any, **kwargs: Any) -> Any:
        return original(*args, origins=[pattern, None], **kwargs)

    with mock.patch.object(websockets.asyncio.server, "serve", serve):
        yield
