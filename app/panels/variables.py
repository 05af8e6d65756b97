"""Everything that is known of the selected vertex."""

import numpy as np
import viser

from app.html import number, table, text
from app.outcome import short_reason, slot_of
from app.panels.html_panel import HtmlPanel
from app.run_state import RunState
from app.view import View
from fairing.mesh import Mesh
from fairing.trace import StepReason, StepRecord


class Variables:
    """Of the current vertex of the selection."""

    def __init__(self, gui: viser.GuiApi, mesh: Mesh) -> None:
        self._mesh = mesh
        self._panel = HtmlPanel(gui)

    def show(self, state: RunState, view: View) -> None:
        vertex = view.selected
        if vertex is None:
            self._panel.set("")
            return
        here, start = state.vertices[vertex], state.trace.start[vertex]
        moved = float(np.linalg.norm(here - start))
        content = table(
            [
                ("position", ", ".join(f"{value:.5g}" for value in here)),
                (
                    "moved from the start",
                    f"{number(moved)} <span class='dim'>({number(100 * moved / self._mesh.diagonal, 3)} %)</span>",
                ),
                ("faces around it", str(len(self._mesh.one_rings[vertex]))),
            ]
        )
        found = last_step_of(state, vertex)
        if found is None:
            content += "<div class='note dim'>No step has been about this vertex yet.</div>"
        else:
            moment, record, slot = found
            content += _step(state, moment, record, slot)
        self._panel.set(content)


def last_step_of(state: RunState, vertex: int) -> tuple[int, StepRecord, int] | None:
    """The last step before now that was about a vertex: the moment it led to, the record, the vertex's place in it."""
    for moment in range(state.moment, 0, -1):
        record = state.trace.steps[moment - 1]
        slot = slot_of(record, vertex)
        if slot is not None:
            return moment, record, slot
    return None


def _step(state: RunState, moment: int, record: StepRecord, slot: int) -> str:
    reason = StepReason(int(record.reasons[slot]))
    proposed = float(np.linalg.norm(record.proposed[slot]))
    done = float(np.linalg.norm(record.after[slot] - record.before[slot]))
    smallest, middle, largest = (float(value) for value in record.eigenvalues[slot])
    when = "this step" if moment == state.moment else f"{state.moment - moment} steps ago"
    color = "rejected" if short_reason(reason).startswith("rejected") else "start" if done > 0 else "dim"
    return (
        f"<h4>Its last step <span class='dim'>({text(when)}, to moment {moment})</span></h4>"
        f"<div class='{color}'>{text(reason.text)}</div>"
        + table(
            [
                ("step in the photos", f"{number(float(record.step_px[slot]))} px"),
                ("step proposed", number(proposed)),
                ("step made", number(done)),
                ("damping", number(float(record.damping[slot]))),
                ("rejections in a row", str(int(record.rejections[slot]))),
                ("eigenvalues", f"{number(smallest, 3)} · {number(middle, 3)} · {number(largest, 3)}"),
                ("weakest / strongest", number(smallest / largest, 3) if largest > 0 else "–"),
                ("energy of the unit", f"{number(record.energy_before)} → {number(record.energy_after)}"),
                ("energy with priors, tried", f"{number(record.objective_before)} → {number(record.objective_after)}"),
            ]
        )
    )
