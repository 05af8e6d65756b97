"""Past moment: the state that one browser shows when it views a past moment during a run."""

from dataclasses import replace

from app.debugger.run_state import Activity, RunState
from app.page_state.page_state import PageState


def at_viewed_moment(state: RunState, view: PageState) -> RunState:
    """The state at the moment that this browser views. When the run pauses, all browsers return to the present moment."""
    if state.activity is not Activity.RUNNING or (view.viewed_moment is not None and view.viewed_moment > state.length):
        view.viewed_moment = None
    if view.viewed_moment is None:
        return state
    moment = view.viewed_moment
    position = state.trace.steps[moment].position if moment < state.length else state.position
    vertices = state.trace.vertices_at(moment) if moment < state.length else state.vertices
    return replace(state, moment=moment, vertices=vertices, position=position, finished=False)
