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
    is_past = moment < state.length
    position = state.trace.steps[moment].position if is_past else state.position
    next_stage = state.trace.steps[moment].stage if is_past else state.next_stage
    vertices = state.trace.vertices_at(moment) if is_past else state.vertices
    return replace(state, moment=moment, vertices=vertices, position=position, next_stage=next_stage, finished=False)
