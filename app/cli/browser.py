"""Opens the page in a browser, or describes how to reach it where no browser can be opened."""

import getpass
import os
import socket
import sys
import webbrowser
from collections.abc import Mapping
from pathlib import Path

CONTAINER_FILES = (Path("/.dockerenv"), Path("/run/.containerenv"))


def open_page(url: str, port: int) -> list[str]:
    """Open a page in the user's browser; returns the lines to print if there is none on this machine.

    Args:
        url: the page's address on this machine.
        port: in that address.
    """
    if can_open_browser(os.environ, sys.platform):
        try:
            if webbrowser.open(url):
                return []
        except (webbrowser.Error, OSError):  # a browser that is registered but cannot be started
            pass
    in_container = any(file.exists() for file in CONTAINER_FILES) or "container" in os.environ
    return how_to_reach(url, port, os.environ, in_container)


def can_open_browser(environment: Mapping[str, str], platform: str) -> bool:
    """Whether this machine has a screen for a browser: text browsers would take over the terminal."""
    if "BROWSER" in environment:
        return True
    if platform == "win32":
        return True
    if platform == "darwin":
        return "SSH_CONNECTION" not in environment
    return bool(environment.get("DISPLAY") or environment.get("WAYLAND_DISPLAY"))


def how_to_reach(url: str, port: int, environment: Mapping[str, str], in_container: bool) -> list[str]:
    """Lines that describe how to reach a page from a machine with a browser."""
    if in_container:
        return [
            "No browser can be opened in this container. To reach the page from outside:",
            f"  start the container with   -p 127.0.0.1:{port}:{port}",
            f"  and this command with      --host 0.0.0.0 --port {port}",
            "  then open the address that it prints, with 127.0.0.1 as the host.",
        ]
    # The third field is the address of this machine, as the user's machine knows it.
    fields = environment.get("SSH_CONNECTION", "").split()
    host = fields[2] if len(fields) == 4 else socket.gethostname()
    return [
        "No browser can be opened on this machine. To reach the page from yours, run there",
        f"  ssh -N -L {port}:127.0.0.1:{port} {_user()}@{host}",
        f"and open {url}",
    ]


def _user() -> str:
    try:
        return getpass.getuser()
    except (KeyError, OSError, ImportError):  # a user without a name, as in some containers
        return "USER"
