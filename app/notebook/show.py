"""`show`: a run or an experiment as a frame in a notebook."""

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Literal, overload

from app.files.run_files import TRACE
from app.notebook.frame import HEIGHT, Frame
from app.notebook.measuring import Measured, read_measured
from app.notebook.progress import progress
from fairing.errors import InputError
from fairing.run.session import Session

if TYPE_CHECKING:
    from app.notebook.live import LiveDebugger

Shown = Session | Measured | Path | str


@overload
def show(result: Session, *, live: Literal[True], height: int = HEIGHT) -> "LiveDebugger": ...
@overload
def show(result: Shown, *, live: Literal[False] = False, height: int = HEIGHT) -> Frame: ...
def show(result: Shown, *, live: bool = False, height: int = HEIGHT) -> "Frame | LiveDebugger":
    """Show a run or the results of an experiment in a notebook.

    Args:
        result: a session, which opens at its present moment; the folder that `eigenfairing fair` wrote or its run.trace,
            which opens at its end; what `measure` returns; or the folder or the record (.json) of `eigenfairing experiment`.
        live: serve the debugger on the session, on this machine, instead of a page with its record. The session
            belongs to the debugger until its `stop`.
        height: of the frame, px.

    Returns:
        An object that a notebook displays as a frame. A `Frame` contains the exported page and makes no request; its
        `save` writes it to a file. A `LiveDebugger` shows the frame and the address of the page.

    Raises:
        InputError: the result cannot be shown, or its page is too large for a notebook.
    """
    if live:
        from app.notebook.live import LiveDebugger

        if not isinstance(result, Session):
            raise InputError(f"show: live=True expects a session, found {type(result).__name__}")
        return LiveDebugger(result, height)
    if isinstance(result, Measured):
        return result.frame(height)
    if isinstance(result, Session):
        return _run_frame(result, result.moment, None, height)
    if isinstance(result, Path | str):
        return _frame_of_path(Path(result), height)
    raise InputError(
        f"show: expected a session, the results of an experiment, or a path; found {type(result).__name__}"
    )


def _frame_of_path(path: Path, height: int) -> Frame:
    from app.files.outside_photos import outside_photos
    from app.files.recorded_run import find_run
    from fairing.io import PhotoChoice

    is_run = path.suffix != ".json" and ((path / TRACE).exists() or not path.is_dir())
    records = [] if is_run else [path] if path.suffix == ".json" else sorted(path.glob("*.json"))
    if records:
        return read_measured(records[0]).frame(height)
    trace, source, where = find_run(path, None, None, PhotoChoice())
    with progress(f"Opening {source.scene}") as bar:
        session = Session(source.load(lambda fraction, _: bar(fraction)), trace=trace)
        session.choose_inputs(lambda fraction, _: bar(fraction))
    line = outside_photos(source.scene, session.scene.views)
    if line:
        warnings.warn(line, stacklevel=3)
    return _run_frame(session, len(trace), where.parent, height)


def _run_frame(session: Session, moment: int, folder: Path | None, height: int) -> Frame:
    from app.export.page import page_of
    from app.export.run_facts import RunFacts

    copy = Session(session.scene, trace=session.trace.cut(len(session.trace)), like=session, terms=session.terms)
    with progress("Making the page") as bar:
        html = page_of(RunFacts(copy, folder), moment, bar)
    return Frame(html, f"{session.scene.name}: {len(session.trace)} steps", height)
