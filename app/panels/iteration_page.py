"""Iteration page of the cells panel: one Gauss-Newton step of a vertex in its parts, each beside the paper's code."""

from collections.abc import Callable

import numpy as np

from app.debugger.controller import Controller
from app.debugger.iteration_query import IterationFacts, IterationQuery, VertexStep, iteration_facts
from app.debugger.run_state import Activity, RunState
from app.html import button, icon, number, numbers, table, text
from app.page_state.cells_controls import CellsControls
from app.page_state.cells_state import KINDS, PARTS
from app.page_state.page_state import PageState
from app.palette import solid
from app.panels.cell_table import WIDTH, basis_images, singular_value_chart
from app.panels.choice import chip, photo_link
from app.pictures.cell_images import AXES, GAP, CellPictures
from app.pictures.engine_differences import difference_at
from app.pictures.paper_code import CODE, listing
from app.pictures.term_colors import colors_of_terms
from app.query_cache import QueryCache
from fairing.options import FairingOptions
from fairing.scene import Scene
from fairing.trace import StepReason

LIMITS = ("proposed", "longest step", "no folded face")
PICTURES: dict[str, tuple[str, ...]] = {
    "warp": ("photo",),
    "eigenspace": ("photo", "reconstruction"),
    "residual": ("photo", "reconstruction", "residual"),
    "weights": ("residual", "weight"),
    "jacobian": AXES,
}
"""Kinds of the pictures of each photo, by part."""
HEADS = {
    "warp": "I",
    "eigenspace": "I &nbsp; U c",
    "residual": "I &nbsp; U c &nbsp; I − U c",
    "weights": "I − U c &nbsp; weight",
    "jacobian": "∂e/∂x &nbsp; ∂e/∂y &nbsp; ∂e/∂z",
}
PHOTOS_A_ROW = {1: 4, 2: 3, 3: 2}


class IterationSource:
    """The iteration that one browser shows. Queries are posted while the run is paused."""

    def __init__(self, controller: Controller) -> None:
        self._cache: QueryCache[IterationQuery, IterationFacts] = QueryCache(controller.query)

    def newest(
        self, state: RunState, vertex: int, face: int
    ) -> tuple[IterationQuery, IterationFacts | Exception] | None:
        """The latest iteration of the vertex and face, possibly of an earlier moment; None if there is none yet."""
        question = IterationQuery(state.run_id, state.moment, face, vertex)
        if state.activity is Activity.PAUSED:
            self._cache.request(question, lambda session: iteration_facts(session, question))
        found = self._cache.latest
        if found is None or (found[0].run_id, found[0].face, found[0].vertex) != (state.run_id, face, vertex):
            return None
        return found


def iteration_page(
    facts: IterationFacts,
    options: FairingOptions,
    page_state: PageState,
    scene: Scene,
    controls: CellsControls,
    enter: Callable[[str], str],
) -> str:
    """Markup of one part of the iteration."""
    part = page_state.cells.part
    if not facts.cells.takes_part and part in PICTURES:
        shown = (
            f"<div class='note'>Face {facts.cells.face} is not used: {len(facts.cells.views)} photos see it well enough, "
            "three are needed.</div>"
        )
    elif part in PICTURES:
        shown = _OF_CELLS[part](facts) + _photos(facts, part, scene, controls, enter)
    elif facts.step is None:
        shown = "<div class='note'>The sweep of this moment makes no Gauss-Newton step of this vertex.</div>"
    else:
        shown = _OF_STEP[part](facts, facts.step, scene)
    return (
        f"{_parts(part, controls)}{_when(facts)}{shown}"
        f"<h4>In the engine</h4><div>{text(difference_at(part, options, facts))}</div>{_code(part)}"
    )


def _parts(part: str, controls: CellsControls) -> str:
    """The parts as buttons, between those for the previous and the next one."""
    names = list(PARTS)
    at = names.index(part)
    chips = "".join(
        chip(title, controls.part(str(k)), f"Part {k + 1}: {title}", name == part)
        for k, (name, title) in enumerate(PARTS.items())
    )
    moves = "".join(
        button(
            "",
            controls.part(str(at + step)),
            hint=f"{word} part (Shift+{key})",
            icon=icon("one", mirrored=step < 0),
            css_class="small",
            enabled=0 <= at + step < len(names),
        )
        for step, word, key in ((-1, "Previous", "K"), (1, "Next", "J"))
    )
    return (
        f"<div class='row chips'>{chips}</div>"
        f"<div class='row'><span class='big grow'>{at + 1} of {len(names)} · {PARTS[part]}</span>{moves}</div>"
    )


def _when(facts: IterationFacts) -> str:
    """The step that is shown, and whether it has been made."""
    if facts.step is None or not facts.step.trial.is_next:
        note = "as if the turn of this vertex came now; the next step is another one"
    elif facts.is_recorded:
        note = f"recorded, to moment {facts.moment + 1}"
    else:
        note = "tried here only; Step one iteration (I) makes it"
    return f"<div class='dim'>Step from moment {facts.moment}: {note}.</div>"


# ---------------------------------------------------------------------- parts of the face


def _warp(facts: IterationFacts) -> str:
    cells = facts.cells
    return f"<div>{len(cells.views)} cells of face {cells.face}, {cells.size} × {cells.size} samples each.</div>"


def _eigenspace(facts: IterationFacts) -> str:
    cells = facts.cells
    return (
        f"<div>k = {len(cells.basis)} of {len(cells.views)} dimensions.</div>{basis_images(cells)}"
        f"<div class='charts'><div>{singular_value_chart(cells)}</div></div>"
    )


def _residual(facts: IterationFacts) -> str:
    cells = facts.cells
    rms = float(np.sqrt(np.mean(cells.residual[cells.counts].astype(float) ** 2)))
    return f"<div>Root mean square {number(rms, 3)} grey levels.</div>"


def _weights(facts: IterationFacts) -> str:
    cells = facts.cells
    rows = [("norm", text(cells.norm.replace("_", " "))), ("σ", f"{number(cells.sigma, 3)} grey levels")]
    if np.isfinite(cells.outlier_threshold):
        beyond = 100 * float(np.mean(np.abs(cells.residual[cells.counts]) > cells.outlier_threshold))
        rows.append(("outlier threshold", f"{number(cells.outlier_threshold, 3)} grey levels"))
        rows.append(("samples beyond it", f"{number(beyond, 3)} %"))
    return table([*rows, ("energy of the face", number(cells.energy))])


def _jacobian(facts: IterationFacts) -> str:
    derivatives = facts.cells.derivatives
    assert derivatives is not None
    left = float((derivatives.of_residuals**2).sum() / max(float((derivatives.of_cells**2).sum()), 1e-300))
    return (
        f"<div>By the position of vertex {derivatives.vertex}, along the world axes. The eigenspace can take up "
        f"{100 * (1 - left):.1f} % of the derivative (of its sum of squares).</div>"
    )


def _photos(
    facts: IterationFacts, part: str, scene: Scene, controls: CellsControls, enter: Callable[[str], str]
) -> str:
    """The pictures of all photos; a click on one enlarges it, where the lens can show its kind."""
    kinds, cells, pictures = PICTURES[part], facts.cells, CellPictures(facts.cells)
    across = PHOTOS_A_ROW[len(kinds)]
    tile = (WIDTH - 8 * (across - 1)) // (across * len(kinds)) - GAP

    def photo(row: int, view: int) -> str:
        name = scene.views[view].name
        picture = f"<img src='{pictures.strip(row, kinds, tile)}' alt='{PARTS[part]} in {text(name)}'>"
        if kinds[-1] in KINDS:
            press = controls.lens_of(view, kinds[-1])
            label = f"aria-label='Enlarge {PARTS[part].lower()} in {text(name)}'"
            picture = f"<div class='tiles' role='button' tabindex='0' {label} onclick=\"{text(press)}\">{picture}</div>"
        return f"<div><div class='one'>{photo_link(view, name, enter(str(view)))}</div>{picture}</div>"

    found = "".join(photo(row, view) for row, view in enumerate(cells.views.tolist()))
    legends = "".join(pictures.legend(kind) for kind in kinds[-1:])
    return (
        f"<div class='dim'>{HEADS[part]}, by photo</div>{legends}"
        f"<div class='parts' style='grid-template-columns:repeat({across},minmax(0,1fr))'>{found}</div>"
    )


# ---------------------------------------------------------------------- parts of the vertex


def _normal(facts: IterationFacts, step: VertexStep, scene: Scene) -> str:
    whole, colors = step.normal_matrix, colors_of_terms(facts.terms)
    size = max(float(np.linalg.norm(whole)), 1e-300)
    rows = "".join(
        f"<tr><th><span><i class='swatch' style='background:{solid(colors[name])}'></i>{text(name)}</span></th>"
        f"<td class='n'>{number(float(np.trace(H)), 3)}</td><td class='n'>{number(_condition(H), 3)}</td></tr>"
        for name, H in step.hessians.items()
        if np.linalg.norm(H) > 1e-12 * size
    )
    return (
        f"{_matrix(whole)}{_ellipse(whole)}"
        "<table class='pulls'><tr><th>term</th><th class='n' title='Sum of the eigenvalues'>trace</th>"
        "<th class='n' title='Smallest over largest eigenvalue'>λ<sub>min</sub> / λ<sub>max</sub></th></tr>"
        f"{rows}<tr><th>all</th><td class='n'>{number(float(np.trace(whole)), 3)}</td>"
        f"<td class='n'>{number(_condition(whole), 3)}</td></tr></table>"
        f"<div class='dim'>Of the photos, face {facts.cells.face} gives {_share(step.of_face, step.hessians['photos'])} "
        "of the trace. Energy / world unit².</div>"
    )


def _condition(H: np.ndarray) -> float:
    values = np.linalg.eigvalsh(H)
    return float(max(values[0], 0) / values[2]) if values[2] > 0 else 0.0


def _share(part: np.ndarray, whole: np.ndarray) -> str:
    total = float(np.trace(whole))
    return f"{100 * float(np.trace(part)) / total:.0f} %" if total > 0 else "none"


def _matrix(H: np.ndarray) -> str:
    """The numbers with a common power of ten."""
    largest = float(np.abs(H).max())
    power = int(np.floor(np.log10(largest))) if largest > 0 else 0
    rows = "".join(
        "<tr>" + "".join(f"<td class='n'>{number(float(v) / 10.0**power, 3)}</td>" for v in row) + "</tr>" for row in H
    )
    scale = f"<span>· 10<sup>{power}</sup></span>" if power else ""
    return f"<div class='row'><table class='matrix'>{rows}</table>{scale}</div>"


def _ellipse(H: np.ndarray) -> str:
    """The ellipse of equal energy in the plane of the best and the worst determined direction, and the eigenvalues."""
    values, vectors = np.linalg.eigh(H)
    if values[2] <= 0:
        return "<div class='note'>No term determines the vertex.</div>"
    ratio = float(np.sqrt(max(values[0], 0) / values[2]))
    long, short = 44.0, max(44.0 * ratio, 0.6)
    worst, best = (" ".join(f"{v:+.2f}".replace("-", "−") for v in vectors[:, k]) for k in (0, 2))
    listed = table(
        [
            *((f"λ{'₁₂₃'[2 - k]}", number(float(values[k]), 3)) for k in (2, 1, 0)),
            ("best", best),
            ("worst", worst),
        ]
    )
    return (
        "<div class='row'><svg class='ellipse' viewBox='-50 -50 100 100' role='img' aria-label='ellipse of equal energy'>"
        f"<line x1='-48' x2='48'/><line y1='-48' y2='48'/><ellipse rx='{long:.1f}' ry='{short:.1f}'/></svg>"
        f"<div class='grow'>{listed}</div></div><div class='dim'>Steps of equal energy: across, the worst determined "
        "direction; upright, the best.</div>"
    )


def _solve(facts: IterationFacts, step: VertexStep, scene: Scene) -> str:
    trial = step.trial
    rows = [
        ("step δη, world units", numbers(step.steps[0], 3)),
        ("length, world units", number(float(np.linalg.norm(step.steps[0])), 3)),
        ("length in the photo where it is longest", f"{number(float(step.steps_px[0]), 3)} px"),
        ("damping", number(float(trial.proposal.damping[step.slot]), 2)),
        ("gradient g", numbers(trial.proposal.gradients[step.slot], 3)),
    ]
    if trial.block.coupled:
        rows.append(("vertices in the system", str(len(trial.block.vertices))))
        rows.append(("step with the others fixed", f"{number(step.alone_px, 3)} px"))
    return table(rows)


def _limit(facts: IterationFacts, step: VertexStep, scene: Scene) -> str:
    rows = []
    for k, name in enumerate(LIMITS):
        unchanged = k > 0 and (step.steps[k] == step.steps[k - 1]).all()
        value = (
            "<span class='dim'>unchanged</span>"
            if unchanged
            else f"{number(float(step.steps_px[k]), 3)} px <span class='dim'>"
            f"({number(float(np.linalg.norm(step.steps[k])), 3)} world units)</span>"
        )
        rows.append((name, value))
    return table([*rows, ("step that is tried, world units", numbers(step.steps[-1], 3))])


def _accept(facts: IterationFacts, step: VertexStep, scene: Scene) -> str:
    record = step.trial.record
    reason = StepReason(int(record.reasons[step.slot]))
    moved = bool((record.after[step.slot] != record.before[step.slot]).any())
    before, after = record.objective_before, record.objective_after
    count = len(record.vertices)
    of = "this vertex" if count == 1 else f"all {count} vertices of the step"
    fall = f"{'−' if after <= before else '+'}{number(abs(after - before), 3)}"
    content = table(
        [
            (f"objective of {of}, before", number(before, 6)),
            ("with the step that is tried", f"{number(after, 6)} <span class='dim'>({fall})</span>"),
            ("photos around this vertex, before", number(step.ring_energy[0], 5)),
            ("and after the step", number(step.ring_energy[1], 5) if moved else "unchanged"),
        ]
    )
    css_class = "start" if moved or reason is StepReason.CONVERGED else "rejected"
    return f"<div class='big {css_class}'>{text(reason.text.capitalize())}</div>{content}"


_OF_CELLS: dict[str, Callable[[IterationFacts], str]] = {
    "warp": _warp,
    "eigenspace": _eigenspace,
    "residual": _residual,
    "weights": _weights,
    "jacobian": _jacobian,
}
_OF_STEP: dict[str, Callable[[IterationFacts, VertexStep, Scene], str]] = {
    "normal": _normal,
    "solve": _solve,
    "limit": _limit,
    "accept": _accept,
}


def _code(part: str) -> str:
    """The paper's code."""
    return (
        "<h4>In the paper <span class='dim'>(fairing/paper.py)</span></h4>"
        f"<div class='listing' role='figure' aria-label='Lines of fairing/paper.py'>{''.join(map(listing, CODE[part]))}</div>"
    )
