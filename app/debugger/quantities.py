"""Step quantities: the names and functions that conditions and watch expressions may use."""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType

import numpy as np

from app.debugger.condition import ANY, Condition, Quantities, parse_condition
from app.debugger.moment_pulls import MomentPulls, moment_pulls, term_word
from app.debugger.step_text import short_reason, slot_of
from fairing.cells.visibility import Visibility
from fairing.errors import Cancelled, InputError
from fairing.judge.inspect import face_cells
from fairing.run.session import Session, SweepState
from fairing.scene import Scene
from fairing.stage_kind import StageKind
from fairing.terms.names import TERMS
from fairing.trace import StepReason, StepRecord

MAX_FACES = 60  # whose cells are computed for one value of `outliers`

VALUES: dict[str, str] = {
    "moment": "the moment the step leads to",
    "level": "level, from 1",
    "sweep": "sweep within the level, from 1",
    "unit": "place of the vertex or set within the sweep, from 1",
    "iteration": "iteration of the vertex or set, from 1",
    "energy": "energy of the faces around the stepped vertices, after the step; undefined in a fit",
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
    "view": "change of the energy in this view; views are counted from 1, as on the keyboard",
    "outliers": "fraction of the step's samples in this view that are outliers, 0 to 1; slow",
    "pull": "part of a term in the next step, pixels in a photo: of a vertex, or the longest of any vertex",
    "share": "share of a term in the information along the next step, 0 to 1: of a vertex, or of all together",
    "stage": "1 if the step belongs to a stage of this kind",
    "abs": "absolute value",
}
ITEMS: dict[str, str] = {
    "about": "vertex",
    "moved": "vertex",
    "travelled": "vertex",
    "displaced": "vertex",
    "view": "view",
    "outliers": "view",
    "pull": "term",
    "share": "term",
    "stage": "stage",
}
"""What the argument of a function selects. The word itself as argument selects the largest value: `outliers(view)`. After a
term a vertex may follow: `pull(points, 17)`."""
OF_PULLS = frozenset({"pull", "share"})
PREDICATES = {"about", "stage"}
STAGE_WORDS: dict[str, StageKind] = {kind.label.replace(" ", "_"): kind for kind in StageKind}
"""Kinds of stages by the word that names them in conditions."""


def item_words(terms: Iterable[str] = TERMS) -> dict[str, tuple[str, ...]]:
    """The words that a condition may use for a term and for a kind of stage, from the names of a run's terms."""
    return {"term": tuple(map(term_word, terms)), "stage": tuple(STAGE_WORDS)}


def parse_step_condition(
    text: str, limits: Mapping[str, int] = MappingProxyType({}), terms: Iterable[str] = TERMS
) -> Condition:
    """A condition over `VALUES` and `FUNCTIONS`.

    Args:
        limits: number of valid arguments of functions that select by index, see `limits_of`.
        terms: names that it may use. In a run without one of them, that term has no pull.

    Raises:
        InputError: it cannot be parsed, names a vertex or view that does not exist, is a number without a comparison, or a
            constant.
    """
    condition = parse_condition(
        text, set(VALUES), set(FUNCTIONS), limits, items=ITEMS, predicates=PREDICATES, words=item_words(terms)
    )
    if condition.is_constant:
        raise InputError(
            f"condition, column 1: it is constant; expected a quantity such as rejected > 0 (at: ⟨here⟩{text})"
        )
    if not condition.is_truth:
        raise InputError(
            f"condition, column 1: a number; expected a comparison such as {_compared(text)} (at: ⟨here⟩{text})"
        )
    return condition


def _compared(text: str) -> str:
    """An example that compares what was typed, if that is short."""
    return f"{text.strip()} > 0" if len(text.strip()) <= 20 else "rejected > 0"


@dataclass(frozen=True, eq=False)
class StepContext:
    """The context of a step, for quantities that are not recorded with it.

    Attributes:
        session: at the moment after the step.
        stopped: (n, 3) float, the vertices when the run last stopped, world units.
    """

    session: Session
    stopped: np.ndarray


def quantities_of(
    record: StepRecord, moment: int, context: StepContext | None = None, pulls: MomentPulls | None = None
) -> Quantities:
    """The quantities of a step, computed on demand; NaN where a quantity is not defined.

    Args:
        moment: after the step.
        pulls: at that moment, if they are known; else they are computed with the context.
    """
    names = [short_reason(StepReason(int(reason))) for reason in record.reasons]
    measured = len(record.faces) > 0 or not record.stage.is_fit
    before, after = (record.energy_before, record.energy_after) if measured else (float("nan"), float("nan"))

    def weakest() -> float:
        known = record.eigenvalues[record.eigenvalues[:, 2] > 0]
        return float((known[:, 0] / known[:, 2]).min()) if len(known) else float("nan")

    def moved(vertex: float) -> float:
        if vertex == ANY:
            return float(record.step_px[(record.before != record.after).any(axis=1)].max(initial=0))
        slot = slot_of(record, int(vertex)) if vertex == vertex and abs(vertex) < 1e9 else None
        made = slot is not None and (record.before[slot] != record.after[slot]).any()
        return float(record.step_px[slot]) if slot is not None and made else 0.0

    def view(number: float) -> float:
        changes = record.view_energy_after - record.view_energy_before
        if number == ANY:
            return float(changes.max())
        return float(changes[int(number) - 1]) if 1 <= number < len(changes) + 1 else float("nan")

    def seen_changes() -> float:
        if context is None or record.sweep_moment == 0 or record.position[2:] != (0, 0):
            return 0.0 if context is not None else float("nan")
        now, then = (_seen(context.session.sweep_state(at)) for at in (moment - 1, record.sweep_moment - 1))
        return float(np.count_nonzero(now != then))

    def travelled(vertex: float) -> float:
        return float("nan") if context is None else _apart(context.session, context.stopped, vertex)

    def displaced(vertex: float) -> float:
        return float("nan") if context is None else _apart(context.session, context.session.trace.start, vertex)

    def outliers(number: float) -> float:
        n_views = len(record.view_energy_after)
        if context is None or not (number == ANY or 1 <= number < n_views + 1):
            return float("nan")
        shares = _outlier_shares(context.session, record, moment)
        if number == ANY:
            return float(np.nanmax(shares)) if np.isfinite(shares).any() else float("nan")
        return float(shares[int(number) - 1])

    @cache
    def known_pulls() -> MomentPulls | None:
        return pulls if pulls is not None or context is None else moment_pulls(context.session, moment)

    def pull(word: str, vertex: float = ANY) -> float:
        found = known_pulls()
        return float("nan") if found is None else _of_any(found.px_of(_term_of(word, found)), vertex)

    def share(word: str, vertex: float = ANY) -> float:
        found = known_pulls()
        if found is None:
            return float("nan")
        k = found.index_of(_term_of(word, found))
        if k is None:
            return 0.0
        return float(found.shares_of_all[k]) if vertex == ANY else _of_vertex(found.shares[k], vertex)

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
    functions: dict[str, Callable[..., float]] = {
        "about": lambda vertex: float(vertex == ANY or (record.vertices == vertex).any()),
        "moved": moved,
        "travelled": travelled,
        "displaced": displaced,
        "view": view,
        "outliers": outliers,
        "pull": pull,
        "share": share,
        "stage": lambda word: float(record.stage is STAGE_WORDS[word]),
        "abs": math.fabs,
    }
    return Quantities(values, functions)


def _term_of(word: str, found: MomentPulls) -> str:
    """The name of a term of the run by its word; the word itself if the run has no such term."""
    return next((name for name in found.meanings if term_word(name) == word), word)


def _of_any(values: np.ndarray, vertex: float) -> float:
    """The value (n,) of a vertex, or the largest of any."""
    return float(values.max()) if vertex == ANY else _of_vertex(values, vertex)


def _of_vertex(values: np.ndarray, vertex: float) -> float:
    """The value (n,) of a vertex; NaN if there is no such vertex."""
    return float(values[int(vertex)]) if 0 <= vertex < len(values) else float("nan")


def _seen(sweep: SweepState) -> np.ndarray:
    """(m, V) bool: whether a view sees a face, or a part of it."""
    return sweep.context.reasons <= Visibility.PARTLY_SEEN


def _apart(session: Session, then: np.ndarray, vertex: float) -> float:
    """Distance of a vertex, or the largest of any vertex, from an earlier position, px, in the view where it is largest."""
    if vertex != ANY and not 0 <= vertex < len(then):
        return float("nan")
    ids = np.flatnonzero((then != session.vertices).any(axis=1)) if vertex == ANY else [int(vertex)]
    pairs = np.stack([then[ids], session.vertices[ids]], axis=1)
    longest = 0.0
    for view in session.scene.views:
        uv, depth = view.camera.project(pairs)
        inside = ((uv >= 0) & (uv < [view.camera.width, view.camera.height])).all(axis=(1, 2)) & (depth > 0).all(axis=1)
        longest = max(longest, float(np.linalg.norm(uv[inside, 1] - uv[inside, 0], axis=1).max(initial=0)))
    return longest


def _outlier_shares(session: Session, record: StepRecord, moment: int) -> np.ndarray:
    """(V,) float: fraction of outliers among the samples of the step's faces by view, NaN where there are none.

    At most `MAX_FACES` faces are sampled.
    """
    outliers, samples = np.zeros((2, len(record.view_energy_after)))
    for face in record.faces[:: max(1, -(-len(record.faces) // MAX_FACES))]:
        if session.cancel_requested():
            raise Cancelled
        cells = face_cells(session, int(face), moment)
        outliers[cells.views] += np.count_nonzero(np.abs(cells.residual) > cells.outlier_threshold, axis=1)
        samples[cells.views] += cells.counts.sum(axis=1)
    return np.divide(outliers, samples, out=np.full(len(samples), np.nan), where=samples > 0)


def limits_of(scene: Scene) -> dict[str, int]:
    """Number of vertices or views that a function's argument may name, for terms the one after the comma, by function."""
    counts = {"vertex": len(scene.mesh.vertices), "view": len(scene.views), "term": len(scene.mesh.vertices)}
    return {function: counts[item] for function, item in ITEMS.items() if item in counts}
