"""Serves the page of the debugger or of a flip record until Ctrl-C.

The server starts before the engine: a browser takes as long to load the viewer as the engine takes to import and a small
scene to load, so the address is printed, and the browser opened, before either has begun.
"""

import contextlib
import signal
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from app.cli.arguments import PageAddress
from app.cli.browser import open_page
from app.cli.loading import SKIPPABLE, OpeningProgress
from app.viser_bridge.server import ViewerServer, start_viewer
from fairing.errors import InputError

if TYPE_CHECKING:
    from app.debugger.engine_compilation import EngineCompilation
    from fairing.run.session import Session

WAIT_SECONDS = 0.5  # a Ctrl-C that arrives just before a wait begins does not end it, so no wait is long


def serve(
    open_session: Callable[[OpeningProgress], "Session"],
    address: PageAddress,
    *,
    title: str,
    save_to: Path | None = None,
    recorded_in: Path | None = None,
    page_first: bool = True,
    lesson: str | None = None,
) -> None:
    """Open the debugger, paused, and return after Ctrl-C.

    Args:
        open_session: returns the run; receives the callbacks of the page that is shown meanwhile.
        address: where the page is.
        title: of the scene.
        save_to: file that the trace is written to.
        recorded_in: file that the trace was read from; its bookmarks lie beside it.
        page_first: start the server before `open_session` is called. Not for a run that exists already: a Ctrl-C
            while the page starts would lose it.
        lesson: name of the lesson that the first browser opens; the session is on its scene.

    Raises:
        InputError: the address cannot be used, `save_to` cannot be written, or the bookmarks cannot be read; or what
            `open_session` raises.
    """

    def open_app(server: ViewerServer) -> Callable[[], None]:
        page = server.opening
        page.begin(f"Opening {title}", lambda: "")
        page.show("Loading the engine")
        from app.debugger.actions import ACTIONS
        from app.debugger.engine_compilation import EngineCompilation
        from app.debugger.engine_compiler import is_compiled
        from app.debugger.overload_memory import remember_overloads
        from app.page.server import App

        def show(line: str, fraction: float | None) -> None:
            page.show(f"{line[:1].upper()}{line[1:]}", fraction, can_skip=line.startswith(SKIPPABLE))

        page.accept_keys((a.label, *key) for a in ACTIONS for key in a.keys)
        compilation = None
        if not is_compiled():
            remember_overloads()  # the renderer of demo scenes is compiled in this process
            compilation = EngineCompilation()
        page.begin(f"Opening {title}", lambda: _line_of(compilation))
        page.show("Reading the scene")
        try:
            session = open_session(OpeningProgress(show, page.skip_requested))
            page.show("Building the page")
            return App(server, session, save_to, recorded_in, lesson, compilation).stop
        except BaseException:
            if compilation is not None:
                compilation.close()
            raise

    serve_app(open_app, address, page_first=page_first)


def _line_of(compilation: "EngineCompilation | None") -> str:
    """A line about what is compiled at present; empty if nothing is."""
    from app.debugger.compile_watch import compiling

    report = (None if compilation is None else compilation.report) or compiling()
    return "" if report is None else report.line


def serve_app(
    open_app: Callable[[ViewerServer], Callable[[], None]], address: PageAddress, *, page_first: bool = True
) -> None:
    """Serve until Ctrl-C what `open_app` adds to the server; it returns the function that stops both. See `serve`."""
    server = start_viewer(address.host, address.port, address.token)
    stop: Callable[[], None] = server.close
    try:
        with contextlib.suppress(KeyboardInterrupt), remembered_interrupt() as interrupts:
            if page_first:
                _announce(server, address)
            stop = open_app(server)
            if not page_first:
                _announce(server, address)
            never = threading.Event()
            while not interrupts:
                never.wait(timeout=WAIT_SECONDS)
    except InputError as error:
        problem = str(error)
        stop = lambda: server.close(problem)  # noqa: E731 - replaces the function of the same name
        raise
    finally:
        stop()


@contextlib.contextmanager
def remembered_interrupt() -> Iterator[list[int]]:
    """Ctrl-C raises KeyboardInterrupt as always, and is also added to the list that is returned.

    The exception can be lost: in a finalizer, in a callback from compiled code, or in an `except:` of a library that is
    being imported. Starting the engine runs many of those. (A list, because the lock of an Event may be held by the very
    code that is interrupted.)
    """
    interrupts: list[int] = []

    def interrupt(number: int, frame: object) -> None:
        interrupts.append(number)
        raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():  # only the main thread can handle signals
        yield interrupts
        return
    before = signal.signal(signal.SIGINT, interrupt)
    try:
        yield interrupts
    finally:
        signal.signal(signal.SIGINT, before)


def _announce(server: ViewerServer, address: PageAddress) -> None:
    print(f"EigenFairing is at {server.url} - Ctrl-C ends it.", flush=True)  # noqa: T201 - the line that users need
    if server.url_for_others:
        print(f"From other machines: {server.url_for_others}", flush=True)  # noqa: T201
    if address.browser:
        for line in open_page(server.url, server.get_port()):
            print(line, flush=True)  # noqa: T201
