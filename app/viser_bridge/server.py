"""The viewer's server: starts viser on one address with access control and bounded queues, and stops it."""

import contextlib
import errno
import io
import socket
import warnings
from typing import Any
from unittest import mock

import viser
import viser._viser
import websockets.asyncio.server
from viser import _messages
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

from app.viser_bridge.access import Access, token_for
from app.viser_bridge.client_callbacks import ClientCallbacks
from app.viser_bridge.malformed_messages import Handler, one_line_each, quiet_logger
from app.viser_bridge.message_event import use_message_buffers
from app.viser_bridge.opening_page import OpeningPage
from app.viser_bridge.paced_connection import MAX_MESSAGE_BYTES, PacedConnection
from app.viser_bridge.software_rendering import close_warning
from fairing.errors import InputError

PANEL_WIDTH = 340  # px
ANY_ADDRESS = {"0.0.0.0": "127.0.0.1", "::": "[::1]"}


def check_address(host: str, port: int) -> None:
    """Check that a server can listen there: viser takes the next free port instead, and hangs on an unknown host.

    Raises:
        InputError: the host is none of this machine's addresses, or the port is in use or not allowed.
    """
    if not 0 <= port <= 65535:
        raise InputError(f"port {port}: expected 0 to 65535")
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind, protocol) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address)
    except (socket.gaierror, UnicodeError):
        raise InputError(f"host {host}: is not known; use 127.0.0.1 or an address of this machine") from None
    except PermissionError:
        raise InputError(f"port {port}: not allowed; choose one above 1023 with --port") from None
    except OSError as error:
        if error.errno == errno.EADDRNOTAVAIL:
            raise InputError(f"host {host}: is no address of this machine; use 127.0.0.1") from None
        raise InputError(f"port {port} on {host}: already in use; choose another with --port") from None


class ViewerServer(viser.ViserServer):
    """A viser server that is safe to leave open on one's machine.

    Args:
        host: the address to listen on.
        port: 0 for any free one.
        token: what browsers have to bring; None: none on this machine, a random one where other machines can connect.

    Raises:
        InputError: the address cannot be used, or the token; see `check_address` and `token_for`.
    """

    def __init__(self, host: str, port: int, token: str | None = None) -> None:
        self.access = Access(host, token_for(host, token))
        check_address(host, port)
        use_message_buffers()
        # What callbacks queue for a browser that has just gone is not delivered, and need not be.
        warnings.filterwarnings("ignore", message="Queued a .* on a closed connection")
        with (
            mock.patch.object(websockets.asyncio.server, "serve", self._serve),
            mock.patch.object(viser._viser, "ThreadPoolExecutor", ClientCallbacks),
            contextlib.redirect_stdout(io.StringIO()),  # viser prints a banner even if `verbose` is false
        ):
            super().__init__(host=host, port=port, verbose=False)
        # A client could open a public tunnel to this page even while the button for it is hidden.
        for request in (_messages.ShareUrlRequest, _messages.ShareUrlDisconnect):
            self._websock_server.unregister_handler(request)
        if port != 0 and self.get_port() != port:
            self.stop()
            raise InputError(f"port {port} on {host}: already in use; choose another with --port")
        self.opening = OpeningPage(self.gui)
        """What browsers show until there is a page."""

    @property
    def url(self) -> str:
        """The page's address on this machine, with the token if there is one."""
        host = self.get_host()
        name = ANY_ADDRESS.get(host, f"[{host}]" if ":" in host else host)
        token = f"/?token={self.access.token}" if self.access.token else ""
        return f"http://{name}:{self.get_port()}{token}"

    @property
    def url_for_others(self) -> str | None:
        """The page's address for other machines, where the server listens on all addresses."""
        host = self.get_host()
        return self.url.replace(ANY_ADDRESS[host], socket.gethostname(), 1) if host in ANY_ADDRESS else None

    def close(self, problem: str = "") -> None:
        """Disconnect all browsers and stop; show them first the problem that was the reason, if any."""
        for client in self.get_clients().values() if problem else ():
            client.add_notification("The scene could not be opened", problem, color="red")
            client.flush()
        self.opening.close()
        with contextlib.redirect_stdout(io.StringIO()):  # viser prints "Server stopped"
            self.stop()

    def _serve(self, handler: Handler, *args: Any, process_request: Any, **kwargs: Any) -> Any:
        """`websockets.asyncio.server.serve` with the checks of this server before viser's own handler."""

        def check(connection: ServerConnection, request: Request) -> Response | None:
            port = connection.transport.get_extra_info("sockname")[1]
            return self.access.answer(request, port) or process_request(connection, request)

        options = {**kwargs, "max_size": MAX_MESSAGE_BYTES, "create_connection": PacedConnection}
        return _plain_serve(one_line_each(handler), *args, process_request=check, logger=quiet_logger(), **options)


_plain_serve = websockets.asyncio.server.serve


def start_viewer(host: str, port: int, token: str | None = None) -> ViewerServer:
    """Serve the page as a browser finds it before there is a scene: dark, with a docked panel.

    Raises:
        InputError: the address cannot be used.
    """
    server = ViewerServer(host, port, token)
    server.gui.configure_theme(dark_mode=True, show_logo=False, show_share_button=False)
    server.gui.set_panel_label("EigenFairing")
    server.gui.main_panel.dock_right()
    server.gui.main_panel.set_width(PANEL_WIDTH)
    # The default environment map takes seconds to decode, and the textures need no light.
    server.scene.configure_environment_map(None)
    server.scene.configure_default_lights(cast_shadow=False)
    server.scene.add_light_ambient("/light", intensity=0.25)
    server.scene.world_axes.visible = False
    close_warning(server.gui)
    return server
