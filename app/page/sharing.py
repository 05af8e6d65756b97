"""Sharing: exports of the current run, made beside the engine and sent to the browser as a download."""

import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import viser

from app.background_worker import BackgroundWorker
from app.debugger.controller import Controller
from app.debugger.run_command import export_command, fair_command
from app.debugger.run_state import RunState
from app.export.page import write_page
from app.export.picture import write_picture
from app.export.report_page import write_report
from app.export.run_facts import RunFacts
from app.export.video import write_video
from app.viser_bridge.error_toasts import ErrorToasts, NothingToDo
from fairing.errors import Cancelled
from fairing.io.refined_mesh import write_refined_mesh
from fairing.run.session import Session

OnProgress = Callable[[float], None]
SHOW_EVERY = 0.5  # s


@dataclass(frozen=True)
class ShareKind:
    """A file that can be made of a run.

    Attributes:
        title: its name for readers.
        ending: of the file.
        arguments: of `eigenfairing export` after the file's name.
        write: writes it, given the run, the moment shown, the path, and a function to be called with the share that is done.
    """

    title: str
    ending: str
    arguments: tuple[str, ...]
    write: Callable[[RunFacts, int, Path, OnProgress], object]


def _mesh(facts: RunFacts, moment: int, path: Path, on_progress: OnProgress) -> None:
    write_refined_mesh(path, facts.scene, facts.trace.vertices_at(moment))


SHARE_KINDS: dict[str, ShareKind] = {
    "page": ShareKind("Page", ".html", (), lambda facts, at, out, show: write_page(facts, out, at, show)),
    "picture": ShareKind("Picture", ".png", (), lambda facts, at, out, show: write_picture(facts, out, None, show)),
    "video": ShareKind("Video", ".mp4", (), lambda facts, at, out, show: write_video(facts, out, show)),
    "report": ShareKind("Report", ".html", ("--report",), lambda facts, at, out, show: write_report(facts, out, show)),
    "mesh": ShareKind("Mesh", ".ply", (), _mesh),
}


class Sharing:
    """The exports of one browser, one at a time.

    Attributes:
        kind: of the export in progress; None without one.
        fraction: share of it that is done, 0 to 1.
        left: remaining time, s; None while it is not known.
    """

    def __init__(self, client: viser.ClientHandle, controller: Controller, toasts: ErrorToasts) -> None:
        self._client, self._controller, self._toasts = client, controller, toasts
        self._worker = BackgroundWorker(controller.republish, name="export")
        self.kind: str | None = None
        self.fraction = 0.0
        self.left: float | None = None
        self._is_cancelled = False

    def make(self, name: str) -> None:
        """Make a file of the current run and send it to the browser.

        Raises:
            NothingToDo: there are no steps yet, or another export is in progress.
        """
        state = self._controller.state
        if self.kind is not None:
            raise NothingToDo(f"the {self.kind} is being made; wait for it, or cancel it")
        if state.length == 0:
            raise NothingToDo("there is nothing to export yet; make a step first")
        self.kind, self.fraction, self.left, self._is_cancelled = name, 0.0, None, False
        self._controller.republish()
        self._worker.post("export", lambda: self._made(name, state), self._send)

    def cancel(self) -> None:
        """Stop the export in progress."""
        self._is_cancelled = True

    def command(self, name: str, state: RunState) -> str:
        """The command line, or the two, that make the same file without the page."""
        record = self._controller.file_of(state.run_id)
        fair = fair_command(self._controller.scene.name, state.trace.header, state.options)
        if name == "mesh":
            return fair
        kind = SHARE_KINDS[name]
        export = export_command(record, f"{name}{kind.ending}", *kind.arguments)
        return export if record is not None else f"{fair} && {export}"

    def close(self) -> None:
        """Stop the export in progress; nothing more is sent."""
        self._is_cancelled = True
        self._worker.close(timeout=0)

    def _made(self, name: str, state: RunState) -> tuple[str, bytes]:
        began, shown = time.monotonic(), 0.0

        def show(fraction: float) -> None:
            nonlocal shown
            if self._is_cancelled:
                raise Cancelled
            now = time.monotonic()
            self.fraction = fraction
            self.left = (now - began) * (1 - fraction) / fraction if fraction > 0.02 else None
            if now > shown + SHOW_EVERY:
                shown = now
                self._controller.republish()

        scene, kind = self._controller.scene, SHARE_KINDS[name]
        facts = RunFacts(Session(scene, trace=state.trace.cut(state.length)))
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"{name}{kind.ending}"
            show(0.0)
            kind.write(facts, state.moment, path, show)
            return f"{scene.name.replace('/', '-').replace(':', '-')}-{name}{kind.ending}", path.read_bytes()

    def _send(self, result: tuple[str, bytes] | Exception) -> None:
        name, self.kind = self.kind, None
        if isinstance(result, Cancelled) or self._is_cancelled:
            return
        if isinstance(result, Exception):
            self._toasts.show(f"The {name} could not be made: {result}")
            return
        self._client.send_file_download(*result, save_immediately=True)
