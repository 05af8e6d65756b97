"""The served process: the debugger on the demo cube, until standard input ends.

It prints its address, then for every line of standard input a line of JSON with its state, see `Facts`.
"""

import ctypes
import json
import logging
import sys
from dataclasses import asdict, dataclass
from typing import Any

from app.debugger.actions import label_of
from app.page.server import App, start
from demo_scenes import load_demo
from fairing.options import PRESETS
from fairing.run.session import Session


@dataclass(frozen=True)
class Facts:
    """The state of the debugger and of its pages.

    Attributes:
        run: number of the current run.
        runs: the numbers of all runs.
        problems: number of refused commands so far.
        movable: the vertices that are not locked and not at their start.
        locked: the locked vertices.
        n_vertices, n_views: of the scene.
        pages: of every page its browser's id, and what its user has chosen.
        errors: messages that the process logged as errors, and of the last failure of the debugger itself.
        commands: the last commands that the controller accepted, the newest last.
        allocated: memory that the C library has handed out and not taken back, MB.
        blocks: Python's allocated blocks of memory, of at most 512 bytes each.
    """

    moment: int
    length: int
    run: int
    runs: list[int]
    activity: str
    is_finished: bool
    problems: int
    movable: list[int]
    locked: list[int]
    n_vertices: int
    n_views: int
    pages: list[dict[str, Any]]
    errors: list[str]
    commands: list[str]
    allocated: float
    blocks: int


class MallocInfo(ctypes.Structure):
    """`struct mallinfo2` of glibc: sums over all heaps, bytes."""

    NAMES = ("arena", "ordblks", "smblks", "hblks", "hblkhd", "usmblks", "fsmblks", "uordblks", "fordblks", "keepcost")
    _fields_ = [(name, ctypes.c_size_t) for name in NAMES]


def allocated_megabytes() -> float:
    """Memory in use within heaps and in mappings of their own; 0 where the C library is not glibc."""
    mallinfo = getattr(ctypes.CDLL(None), "mallinfo2", None)
    if mallinfo is None:
        return 0.0
    mallinfo.restype = MallocInfo
    info = mallinfo()
    return (info.uordblks + info.hblkhd) / 1e6


class Errors(logging.Handler):
    """Collects the messages of errors."""

    def __init__(self) -> None:
        super().__init__(logging.ERROR)
        self.messages: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.messages.append(f"{record.name}: {record.getMessage()} {record.exc_info and record.exc_info[1]!r}")


def facts_of(app: App, errors: list[str]) -> Facts:
    """The present state."""
    state = app.controller.state
    is_free = ~state.locked & (state.vertices != state.trace.start).any(axis=1)
    return Facts(
        moment=state.moment,
        length=state.length,
        run=state.run_id,
        runs=[run.run_id for run in state.runs],
        activity=state.activity.value,
        is_finished=state.finished,
        problems=state.problems,
        movable=is_free.nonzero()[0].tolist(),
        locked=state.locked.nonzero()[0].tolist(),
        n_vertices=len(state.vertices),
        n_views=len(app.controller.scene.views),
        pages=[
            {
                "client": client,
                "selected": page.page_state.selection.vertices,
                "photo": page.page_state.entered,
                "shape": page.page_state.shape,
                "surface": page.page_state.surface,
                "is_view_dependent": page.page_state.is_view_dependent,
                "is_dark": page.camera._theme.is_dark,
            }
            for client, page in list(app.pages.items())
        ],
        errors=[*errors, *([] if state.incident is None else [state.incident.summary])],
        commands=[label_of(command) for command in list(app.controller._queue.history)[-5:]],
        allocated=allocated_megabytes(),
        blocks=sys.getallocatedblocks(),
    )


def main() -> None:
    logging.basicConfig(level=logging.WARNING)
    errors = Errors()
    logging.getLogger().addHandler(errors)
    app = start(Session(load_demo("cube"), PRESETS["paper"]), port=0)
    print(app.url, flush=True)
    for _ in sys.stdin:
        print(json.dumps(asdict(facts_of(app, errors.messages))), flush=True)
    app.stop()


if __name__ == "__main__":
    main()
