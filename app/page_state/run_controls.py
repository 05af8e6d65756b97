"""Run controls: navigation to recorded moments, and breakpoints on the selected vertex."""

from collections.abc import Callable

from app.debugger.breakpoints import Breakpoints
from app.debugger.commands import Back, Command, Extent, Forward, JumpTo, Run, RunBack, ToBeginning
from app.debugger.controller import Controller
from app.debugger.history import next_move
from app.debugger.recorded_values import ITEMS, last_change
from app.debugger.run_state import Activity
from app.page_state.page_state import PageState
from app.viser_bridge.error_toasts import NothingToDo
from app.viser_bridge.html_events import whole_number


class RunControls:
    """The run as one browser controls it. Values come from the browser and are checked.

    All methods raise InputError with one line on a value that makes no sense, and NothingToDo where there is nowhere to go.
    """

    def __init__(self, controller: Controller, page_state: PageState) -> None:
        self._controller, self._page_state = controller, page_state

    def poster(self, command: Command) -> Callable[[], None]:
        """A callback that posts a command; it raises NothingToDo for a step where there is none left."""

        def post() -> None:
            state = self._controller.state
            is_forward, is_back = isinstance(command, Forward | Run), isinstance(command, Back | RunBack)
            if state.activity is Activity.PAUSED and is_forward and state.finished:
                raise NothingToDo("the run has finished: no step is left; restart it, or go back")
            if state.activity is Activity.PAUSED and is_back and state.moment == 0:
                raise NothingToDo("this is the start: there is no earlier step")
            self._controller.post(command)

        return post

    def jump(self, moment: object) -> None:
        """Go to a recorded moment; during a run only this browser shows it, and the run goes on."""
        state = self._controller.state
        wanted = whole_number(moment, 0, max(1, state.length), "moment")
        if state.activity is Activity.RUNNING:
            self._page_state.viewed_moment = wanted
            self._controller.republish()
        else:
            self._controller.post(JumpTo(wanted))

    def to_change(self, n: object) -> None:
        """Go to where a recorded value of the selected vertex last changed."""
        item, state = ITEMS[whole_number(n, 0, len(ITEMS) - 1, "value")], self._controller.state
        if self._page_state.selected is None:
            return
        moment = last_change(item, state.trace.steps, state.moment, self._page_state.selected)
        if moment is None:
            raise NothingToDo(f"{item.name}: did not change before moment {state.moment}")
        self._controller.post(JumpTo(moment))

    def to_beginning(self, extent: object) -> None:
        """Go to the beginning of the present level, stage, sweep or block."""
        self._controller.post(ToBeginning(Extent(whole_number(extent, Extent.STAGE, Extent.BLOCK, "extent"))))

    def to_move_of_selected(self, direction: int) -> None:
        """Go to the next step that moved the selected vertex, forward (1) or back (-1)."""
        selected = self._selected()
        moment = next_move(self._controller.state, selected, direction)
        if moment is None:
            raise NothingToDo(f"vertex {selected}: no {'later' if direction > 0 else 'earlier'} move is recorded")
        self._controller.post(JumpTo(moment))

    def toggle_breakpoint(self) -> None:
        """Add a breakpoint on the selected vertex, or remove it."""
        condition = f"about({self._selected()})"

        def toggled(breakpoints: Breakpoints) -> Breakpoints:
            for item in breakpoints.items:
                if item.condition.text == condition:
                    return breakpoints.removed(item.number)
            return breakpoints.added(condition)

        self._controller.edit_breakpoints(toggled)

    def _selected(self) -> int:
        if self._page_state.selected is None:
            raise NothingToDo("no vertex is selected; click one first")
        return self._page_state.selected
