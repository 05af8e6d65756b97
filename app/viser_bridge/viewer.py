"""The viewer as a browser finds it before there is a scene: dark, docked, without the pictures that take seconds."""

import contextlib
import io

import viser

from app.viser_bridge.security import start_server

PANEL_WIDTH = 340


def start_viewer(host: str, port: int) -> viser.ViserServer:
    """Serve it.

    Raises:
        InputError: the address cannot be used.
    """
    server = start_server(host, port)
    server.gui.configure_theme(dark_mode=True, show_logo=False, show_share_button=False)
    show_opening(server, "opening …")
    server.gui.main_panel.dock_right()
    server.gui.main_panel.set_width(PANEL_WIDTH)
    # The default picture of a room takes seconds to unpack, and the textures need no light.
    server.scene.configure_environment_map(None)
    server.scene.configure_default_lights(cast_shadow=False)
    server.scene.add_light_ambient("/light", intensity=0.25)
    server.scene.world_axes.visible = False
    return server


def show_opening(server: viser.ViserServer, line: str) -> None:
    """Show a line of progress as the panel's title until there is a scene."""
    server.gui.set_panel_label(f"EigenFairing · {line}")


def address_of(server: viser.ViserServer) -> str:
    """Where it is."""
    host = server.get_host()
    return f"http://{'127.0.0.1' if host in ('0.0.0.0', '::') else host}:{server.get_port()}"


def stop_viewer(server: viser.ViserServer, problem: str = "") -> None:
    """Let the browsers go; tell them of a problem that was the reason."""
    for client in server.get_clients().values() if problem else ():
        client.add_notification("The scene could not be opened", problem, color="red")
        client.flush()
    with contextlib.redirect_stdout(io.StringIO()):  # viser says goodbye there
        server.stop()
