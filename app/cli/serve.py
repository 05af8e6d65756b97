"""Serves the debugger on the command line: the page first, then the engine behind it.

A browser takes as long to unpack the viewer as the engine takes to import and a small scene to load; so the address is
said, and the browser opened, before either has begun.
"""

import contextlib
import signal
import threading
import webbrowser
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import viser

from app.cli.loading import ShowLine
from app.viser_bridge.viewer import address_of, show_opening, start_viewer, stop_viewer
from fairing.errors import InputError

if TYPE_CHECKING:
    from fairing.run.session import Session


def serve(
    open_session: Callable[[ShowLine], "Session"],
    *,
    host: str = "127.0.0.1",
    port: int = 8080,
    open_browser: bool = True,
    save_to: Path | None = None,
    recorded_in: Path | None = None,
    page_first: bool = True,
    lesson: str | None = None,
) -> None:
    """Open the debugger, paused, and stay until Ctrl-C.

    Args:
        open_session: makes the run; receives a callback for lines of progress, which the page shows.
        port: 0 for any free one.
        open_browser: also open the page in the user's browser.
        save_to: keep the record in this file.
        recorded_in: the file the record was read from; its bookmarks are beside it.
        page_first: say the address before the run is there: not where a Ctrl-C by then would lose a run made already.
        lesson: name of the lesson that the first browser opens; the session is on its scene.

    Raises:
        InputError: the address cannot be used, `save_to` cannot be written, or the bookmarks cannot be read; or what
            `open_session` raises.
    """

    def open_app(server: viser.ViserServer) -> Callable[[], None]:
        from app.page.server import App

        session = open_session(lambda line: show_opening(server, line))
        return App(server, session, save_to, recorded_in, lesson).stop

    stay(open_app, host, port, open_browser=open_browser, page_first=page_first)


def stay(
    open_app: Callable[[viser.ViserServer], Callable[[], None]],
    host: str,
    port: int,
    *,
    open_browser: bool,
    page_first: bool = True,
) -> None:
    """Serve until Ctrl-C what `open_app` puts into the viewer; it returns how to end it. See `serve`."""
    server = start_viewer(host, port)
    stop: Callable[[], None] = partial(stop_viewer, server)
    try:
        with contextlib.suppress(KeyboardInterrupt), remembered_interrupt() as asked:
            if page_first:
                _invite(address_of(server), open_browser)
            stop = open_app(server)
            if not page_first:
                _invite(address_of(server), open_browser)
            # A Ctrl-C that arrives just before a wait begins does not end it, so none is long.
            never = threading.Event()
            while not asked:
                never.wait(timeout=0.5)
    except InputError as error:
        stop = partial(stop_viewer, server, str(error))
        raise
    finally:
        stop()


@contextlib.contextmanager
def remembered_interrupt() -> Iterator[list[int]]:
    """Ctrl-C raises KeyboardInterrupt as always, and leaves a trace in the list that is given.

    Raised at a bad moment it is swallowed: in a finalizer, a callback from compiled code, or an `except:` of a library
    that is being imported. Opening an engine has many of those, and who pressed once would wait for ever. (A list,
    because an Event's lock may be held by the very code that is interrupted.)
    """
    asked: list[int] = []

    def ask(number: int, frame: object) -> None:
        asked.append(number)
        raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():  # signals are the main thread's
        yield asked
        return
    before = signal.signal(signal.SIGINT, ask)
    try:
        yield asked
    finally:
        signal.signal(signal.SIGINT, before)


def _invite(address: str, open_browser: bool) -> None:
    print(f"EigenFairing is at {address} - Ctrl-C ends it.", flush=True)  # noqa: T201 - the one line a user needs
    if open_browser:
        webbrowser.open(address)
