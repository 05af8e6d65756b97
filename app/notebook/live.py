"""Live debugger of a notebook or a script: the page on a session that the user's own loop may drive."""

import threading
from collections.abc import Iterator
from html import escape

import numpy as np

from app.debugger.commands import Command, Extent, Forward, Place
from app.debugger.run_state import RunState
from app.notebook.frame import HEIGHT
from app.page.server import App, start
from fairing.errors import InputError
from fairing.run.session import Session
from fairing.trace import StepRecord


class LiveDebugger:
    """The debugger on a session, served on this machine until `stop`. The session belongs to it for that time.

    Iterate over it to drive the run: each turn makes one step, which the page shows before the body of the loop runs, also while a
    debugger of Python halts there. What users of the page do meanwhile counts: the next step follows the moment they are at.

        for step in fairing.Session(scene).show():
            ...

    Attributes:
        url: address of the page.
    """

    def __init__(self, session: Session, height: int = HEIGHT) -> None:
        self._app: App = start(session, port=0)
        self._height = height
        self.url = self._app.url

    @property
    def state(self) -> RunState:
        """The moment shown: `vertices` (n, 3) float in world units, `moment`, `record` of the last step, `options` and more."""
        return self._app.controller.state

    def __iter__(self) -> Iterator[StepRecord]:
        """Steps from the present moment to the end of the run.

        Raises:
            InputError: a step failed; the message says why.
        """
        while not (before := self.state).finished:
            state = self._do(Forward(Extent.ITERATION, passes_breakpoints=True))
            has_stepped = (state.run_id, state.moment) != (before.run_id, before.moment)
            if has_stepped and state.record is not None:  # else a user of the page has stopped it
                yield state.record

    def place(self, vertices: np.ndarray, positions: np.ndarray) -> None:
        """Move vertices (u,) int to positions (u, 3) float, world units, as a step of the run.

        Raises:
            InputError: a vertex is locked, or a face would be flipped or collapsed; nothing is moved.
        """
        ids, places = np.asarray(vertices), np.asarray(positions, dtype=float)
        if ids.ndim != 1 or places.shape != (len(ids), 3):
            raise InputError(
                f"place: expected vertices (u,) and positions (u, 3), found {ids.shape} and {places.shape}"
            )
        self._do(Place(tuple(map(int, ids)), tuple((float(x), float(y), float(z)) for x, y, z in places)))

    def stop(self) -> None:
        """End the debugger and free its port."""
        self._app.stop()

    def _do(self, command: Command) -> RunState:
        """The state after a command."""
        controller = self._app.controller
        problems = controller.state.problems
        controller.post(command)
        state = controller.wait_until_idle(threading.TIMEOUT_MAX)  # a step may take minutes
        if state.problems > problems:
            raise InputError(state.problem)
        return state

    def _repr_html_(self) -> str:
        url = escape(self.url)
        return (
            f'<p><a href="{url}" target="_blank">{url}</a></p>'
            f'<iframe src="{url}" title="The debugger" style="width:100%;height:{self._height}px;border:0"></iframe>'
        )

    def __repr__(self) -> str:
        return f"<debugger at {self.url}; stop() ends it>"
