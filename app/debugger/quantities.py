"""Step quantities: the names and functions that conditions and watch expressions may use."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from app.debugger.condition import Condition, Quantities, parse_condition
from app.debugger.step_text import short_reason, slot_of
from fairing.cells.visibility import Visibility
from fairing.errors import Cancelled
from fairing.judge.inspect import face_cells
from fairing.run.session import Session, SweepState
from fairing.scene import Scene
from fairing.trace import StepReason, StepRecord

MAX_FACES = 60  # whose cells are computed for one value of `outliers`

VALUES: dict[str, str] = {
    "moment": "the moment the step leads to",
    "level": "level, from 1",
    "sweep": "sweep within the level, from 1",
    "unit": "unit within the sweep, from 1",
    "iteration": "iteration of the unit, from 1",
    "energy": "energy of the unit's faces after the step",
    "change": "change of that energy by the step",
    "percent": "change of that energy in percent",
    "step_px": "longest step tried, pixels in a photo",
    "damping": "largest damping",
    "rejected": "number of vertices whose step was rejected",
    "accepted": "number of vertices that moved",
    "weakest": "smallest ratio of a vertex's smallest to its largest eigenvalue",
    "seen_changes": "number of pairs of face and view whose visibility changed when this step began a sweep",
}
FUNCTIONS: dict[str, str] = {
    "about": "1 if the step includes this vertex",
    "moved": "distance the step moved this vertex, pixels in a photo",
    "travelled": "distance of this vertex from its position when the run last stopped, pixels in a photo",
    "displaced": "distance of this vertex from its start, pixels in a photo",
    "view": "change of the energy in this view; views count from 0",
    "outliers": "fraction of the step's samples in this view that are outliers, 0 to 1; slow",
    "abs": "absolute value",
}


def parse_step_condition(text: str, limits: Mapping[str, int] = MappingProxyType({})) -> Condition:
    """A condition over `VALUES` and `FUNCTIONS`.

    Args:
        limits: number of valid arguments of functions that select by index, see `limits_of`.

    Raises:
        InputError: it cannot be parsed, or names a vertex or view that does not exist.
    """
    return parse_condition(text, set(VALUES), set(FUNCTIONS), limits)


@dataclass(frozen=True, eq=False)
class StepContext:
    """The context of a step, for quantities that are not recorded with it.

    Attributes:
        session: at the moment after the step.
        stopped: (n, 3) float, the vertices when the run last stopped, world units.
    """

    session: Session
    stopped: np.ndarray


def quantities_of(record: StepRecord, moment: int, context: StepContext | None = None) -> Quantities:
    """The quantities of a step, computed on demand; NaN where a quantity is not defined."""
    names = [short_reason(StepReason(int(reason))) for reason in record.reasons]
    before, after = record.energy_before, record.energy_after

    def weakest() -> float:
        known = record.eigenvalues[record.eigenvalues[:, 2] > 0]
        return float((known[:, 0] / known[:, 2]).min()) if len(known) else float("nan")

    def moved(vertex: float) -> float:
        slot = slot_of(record, int(vertex)) if vertex == vertex and abs(vertex) < 1e9 else None
        made = slot is not None and (record.before[slot] != record.after[slot]).any()
        return float(record.step_px[slot]) if slot is not None and made else 0.0

    def view(index: float) -> float:
        if not 0 <= index < len(record.view_energy_after):
            return float("nan")
        return float(record.view_energy_after[int(index)] - record.view_energy_before[int(index)])

    def seen_changes() -> float:
        if context is None or record.sweep_moment == 0 or record.position[2:] != (0, 0):
            return 0.0 if context is not None else float("nan")
        now, then = (_seen(context.session.sweep_state(at)) for at in (moment - 1, record.sweep_moment - 1))
        return float(np.count_nonzero(now != then))

    def travelled(vertex: float) -> float:
        return float("nan") if context is None else _apart(context.session, context.stopped, vertex)

    def displaced(vertex: float) -> float:
        return float("nan") if context is None else _apart(context.session, context.session.trace.start, vertex)

    def outliers(index: float) -> float:
        return float("nan") if context is None else _outlier_share(context.session, record, moment, index)

    values: dict[str, Callable[[], float]] = {
        "moment": lambda: float(moment),
        "level": lambda: record.position.level + 1.0,
        "sweep": lambda: record.position.sweep + 1.0,
        "unit": lambda: record.position.block + 1.0,
        "iteration": lambda: record.position.iteration + 1.0,
        "energy": lambda: after,
        "change": lambda: after - before,
        "percent": lambda: 100 * (after - before) / before if before else float("nan"),
        "step_px": lambda: float(record.step_px.max(initial=0)),
        "damping": lambda: float(record.damping.max(initial=0)),
        "rejected": lambda: float(sum(name.startswith("rejected") for name in names)),
        "accepted": lambda: float(np.count_nonzero((record.before != record.after).any(axis=1))),
        "weakest": weakest,
        "seen_changes": seen_changes,
    }
    functions: dict[str, Callable[[float], float]] = {
        "about": lambda vertex: float((record.vertices == vertex).any()),
        "moved": moved,
        "travelled": travelled,
        "displaced": displaced,
        "view": view,
        "outliers": outliers,
        "abs": abs,
    }
    return Quantities(values, functions)


def _seen(sweep: SweepState) -> np.ndarray:
    """(m, V) bool: whether a view sees a face, or a part of it."""
    return sweep.context.reasons <= Visibility.PARTLY_SEEN


def _apart(session: Session, then: np.ndarray, vertex: float) -> float:
    """Distance of a vertex from an earlier position, px, in the view where it is largest."""
    if not 0 <= vertex < len(then):
        return float("nan")
    pair = np.stack([then[int(vertex)], session.vertices[int(vertex)]])
    longest = 0.0
    for view in session.scene.views:
        uv, depth = view.camera.project(pair)
        inside = ((uv >= 0) & (uv < [view.camera.width, view.camera.height])).all()
        if (depth > 0).all() and inside:
            longest = max(longest, float(np.linalg.norm(uv[1] - uv[0])))
    return longest


def _outlier_share(session: Session, record: StepRecord, moment: int, index: float) -> float:
    """Fraction of outliers among the samples of the step's faces in one view; at most `MAX_FACES` faces are sampled."""
    outliers = samples = 0
    for face in record.faces[:: max(1, -(-len(record.faces) // MAX_FACES))]:
        if session.cancel_requested():
            raise Cancelled
        cells = face_cells(session, int(face), moment)
        for slot in np.flatnonzero(cells.views == index):
            outliers += int(np.count_nonzero(np.abs(cells.residual[slot]) > cells.outlier_threshold))
            samples += int(cells.counts[slot].sum())
    return outliers / samples if samples else float("nan")


def limits_of(scene: Scene) -> dict[str, int]:
    """Number of vertices or views that a function's argument may name, by function."""
    vertices, views = len(scene.mesh.vertices), len(scene.views)
    return {"about": vertices, "moved": vertices, "travelled": vertices, "displaced": vertices} | {
        "view": views,
        "outliers": views,
    }
