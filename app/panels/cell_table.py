"""Cell table: the cells of a face, one row per photo (the paper's figures 3, 4b and 4c)."""

from collections.abc import Callable

import numpy as np

from app.debugger.cell_queries import CellFacts
from app.html import button, number, numbers, text
from app.page_state.cells_controls import CellsControls
from app.page_state.cells_state import ARROW_KINDS, ARROW_SCALES, HEADS, KINDS, CellsView
from app.palette import css
from app.panels.choice import chip, photo_link
from app.pictures.cell_images import FLOW_COLORS, GAP, CellPictures, strip_of_basis
from fairing.judge.inspect import FaceCells
from fairing.scene import Scene

WIDTH = 338  # px within the panel
MAX_TILE = 112
CHART = (158, 54)


def cell_table(
    facts: CellFacts, cells_view: CellsView, scene: Scene, controls: CellsControls, enter: Callable[[str], str]
) -> str:
    """Markup of the page "Cells"."""
    cells = facts.cells
    if not cells.takes_part:
        return (
            f"<div class='note'>Face {cells.face} is not used: {len(cells.views)} photos see it well enough, "
            "three are needed.</div>"
        )
    tile = min(MAX_TILE, (WIDTH - GAP * (len(cells_view.columns) - 1)) // len(cells_view.columns))
    pictures = CellPictures(cells, facts.flows)
    heads = "".join(
        f"<span style='width:{tile + GAP}px' title='{text(KINDS[kind])}'>{_head(kind, pictures)}</span>"
        for kind in cells_view.columns
    )
    rows = "".join(
        _row(facts, pictures, row, cells_view, tile, scene, controls, enter) for row in range(len(cells.views))
    )
    return (
        f"{_facts(facts, controls)}{_basis(facts, controls)}<h4>Cells by photo</h4>{_chips(facts, cells_view, controls)}"
        f"<div class='row kinds'>{heads}</div>{rows}"
    )


def _head(kind: str, pictures: CellPictures) -> str:
    """The head of a column; above residuals with the grey levels of full colour."""
    scale = f" <span class='dim'>±{number(pictures.residual_scale, 2)}</span>" if kind == "residual" else ""
    return text(HEADS[kind]) + scale


def _facts(facts: CellFacts, controls: CellsControls) -> str:
    cells = facts.cells
    threshold = f" · e<sub>T</sub> {number(cells.outlier_threshold, 3)}" if np.isfinite(cells.outlier_threshold) else ""
    k = len(cells.basis)
    own = ""
    if k != facts.own_dimensions:
        back = button(f"the run's {facts.own_dimensions}", controls.dimensions("0"), hint="Back to the k of the run",
                      css_class="small")  # fmt: skip
        before = float(facts.energies[facts.own_dimensions - 1])
        own = f"<div class='row'><span class='selected'>k = {k} instead of</span>{back}<span class='dim'>energy " \
              f"{number(before)} → {number(cells.energy)}</span></div>"  # fmt: skip
    return (
        f"<div class='dim'>Energy <b>{number(cells.energy)}</b> with k = {k} · {len(cells.views)} photos · "
        f"{cells.size} × {cells.size}</div>"
        f"<div class='dim'>σ {number(cells.sigma, 3)}{threshold} grey levels</div>{own}"
    )


def _basis(facts: CellFacts, controls: CellsControls) -> str:
    """Basis images, singular values, and the energy for every number of dimensions k."""
    cells, k = facts.cells, len(facts.cells.basis)
    # Logarithmic over four decades, because the energy falls steeply with k.
    left = facts.energies / max(float(facts.energies.max(initial=0)), 1e-12)
    fall = _bars(
        1 + np.log10(np.clip(left, 1e-4, 1)) / 4,
        [
            f"k = {i + 1}: energy {number(float(energy))}; click to show the cells with this k"
            for i, energy in enumerate(facts.energies)
        ],
        lambda i: "chosen" if i + 1 == k else "own" if i + 1 == facts.own_dimensions else "",
        lambda i: controls.dimensions(str(i + 1)),
    )
    return (
        f"<h4>Basis images</h4>{basis_images(cells)}"
        f"<div class='charts'><div>{singular_value_chart(cells)}</div>"
        f"<div>{fall}<span class='dim'>energy by k (log scale)</span></div></div>"
    )


def basis_images(cells: FaceCells) -> str:
    """Markup of the basis images side by side."""
    tile = min(60, WIDTH // len(cells.basis) - GAP)
    return f"<img src='{strip_of_basis(cells, tile)}' alt='basis images'>"


def singular_value_chart(cells: FaceCells) -> str:
    """Markup of a bar chart of the singular values; those of the basis are bright."""
    values = np.log1p(cells.singular_values)
    bars = _bars(
        values / max(float(values.max(initial=0)), 1e-12),
        [f"singular value {i + 1}: {number(float(value))}" for i, value in enumerate(cells.singular_values)],
        lambda i: "on" if i < len(cells.basis) else "",
    )
    return f"{bars}<span class='dim'>singular values</span>"


def _bars(
    heights: np.ndarray,
    names: list[str],
    css_class: Callable[[int], str],
    press: Callable[[int], str] | None = None,
) -> str:
    """A bar chart of heights from 0 to 1. With `press`, a click anywhere in a bar's column counts."""
    width, height = CHART
    step = width / max(len(heights), 1)
    parts = []
    for i, value in enumerate(heights.tolist()):
        tall, left = max(1.0, height * value), i * step
        act = "" if press is None else f' onclick="{text(press(i))}" style="cursor:pointer"'
        parts.append(
            f"<g{act}><title>{text(names[i])}</title>"
            f'<rect x="{left:.1f}" width="{step:.1f}" height="{height}" fill="transparent"/>'
            f'<rect class="value {css_class(i)}" x="{left:.1f}" y="{height - tall:.1f}" '
            f'width="{max(step - 2, 1):.1f}" height="{tall:.1f}"/></g>'
        )
    size = f"width:{width}px;height:{height}px"
    return f'<svg class="bars" viewBox="0 0 {width} {height}" style="{size}">{"".join(parts)}</svg>'


def _chips(facts: CellFacts, cells_view: CellsView, controls: CellsControls) -> str:
    """Buttons for the columns shown and for the length of the arrows."""
    columns = "".join(
        chip(
            HEADS[kind],
            controls.column(str(n)),
            f"{'Hide' if kind in cells_view.columns else 'Show'} {KINDS[kind]}",
            kind in cells_view.columns,
        )
        for n, kind in enumerate(KINDS)
    )
    arrows = ""
    if any(kind in ARROW_KINDS for kind in cells_view.columns):
        scales = "".join(
            chip(
                f"×{scale}", controls.scale(str(n)), f"Arrows {scale} times longer than the flow",
                scale == cells_view.arrow_scale,
            )
            for n, scale in enumerate(ARROW_SCALES)
        )  # fmt: skip
        arrows = f"<div class='row chips'><span class='dim'>Arrows</span>{scales}</div>{_flow_note(facts)}"
    return f"<div class='row chips'>{columns}</div>{arrows}"


def _flow_note(facts: CellFacts) -> str:
    if facts.flows is None:
        note = "the face was not used before that step"
    elif facts.flows.moment is None:
        note = "no step yet; f of the current cells"
    else:
        note = f"of the step to moment {facts.flows.moment}"
        note += "; it moved no corner of this face" if facts.flows.model is None else ""
    return f"<div class='dim'>υ, f: {note}</div>"


def _row(
    facts: CellFacts,
    pictures: CellPictures,
    row: int,
    cells_view: CellsView,
    tile: int,
    scene: Scene,
    controls: CellsControls,
    enter: Callable[[str], str],
) -> str:
    cells: FaceCells = facts.cells
    view_id = int(cells.views[row])
    name = scene.views[view_id].name
    seen = 100 * float(cells.counts[row].mean())
    energy = number(float(cells.view_energy[row]), 3)
    coefficients = numbers(cells.coefficients[row], 3)
    width = (tile + GAP) * len(cells_view.columns) - GAP
    paths = "".join(
        f'<path transform="translate({n * (tile + GAP)} 0)" stroke="{css(FLOW_COLORS[kind])}" '
        f'd="{pictures.arrows(row, kind, tile, cells_view.arrow_scale, every=2)}"/>'
        for n, kind in enumerate(cells_view.columns)
        if kind in ARROW_KINDS
    )
    codes = str([controls.code(view_id, kind) for kind in cells_view.columns])
    enlarged = controls.enlarged_by(f"{codes}[ef.column(event,{len(cells_view.columns)},{tile + GAP})]")
    facts_line = f"c = {coefficients} · {seen:.0f} % of the cell seen"
    shown = f"<span class='dim one grow' title='{text(facts_line)}'>c {text(coefficients)}</span>"
    shown += f"<span class='dim'>E {energy}</span>"
    go = photo_link(view_id, name, enter(str(view_id)))
    return (
        f"<div class='cell'><div class='row'>{go}{shown}</div>"
        f"<div class='tiles' role='button' tabindex='0' aria-label='Enlarge a cell in {text(name)}' "
        f"style='width:{width}px;height:{tile}px' {enlarged}>"
        f"<img src='{pictures.strip(row, cells_view.columns, tile)}' alt='cells in {text(name)}'>"
        f"<svg class='over' viewBox='0 0 {width} {tile}'>{paths}</svg></div></div>"
    )
