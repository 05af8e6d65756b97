"""The cells of a face of the selected vertex: the paper's figure 3, live."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import viser

from app.cell_images import KINDS, TILE, strip_of_basis, strip_of_view
from app.commands import Ask
from app.controller import Controller
from app.html import STYLE, button, number, text
from app.panels.html_panel import HtmlPanel
from app.run_state import Activity, RunState
from app.view import View
from fairing.inspect import FaceCells, face_cells
from fairing.scene import Scene
from fairing.session import Session


@dataclass(frozen=True)
class Wanted:
    """The cells of one face at one moment of one run."""

    run_id: int
    moment: int
    face: int


class CellsPanel:
    """Asks the engine for cells whenever it rests and something else is looked at. A click on a photo's row looks
    through it."""

    def __init__(
        self,
        gui: viser.GuiApi,
        controller: Controller,
        scene: Scene,
        choose_face: Callable[[str], str],
        enter: Callable[[str], str],
    ) -> None:
        self._controller, self._scene = controller, scene
        self._choose_face, self._enter = choose_face, enter
        self._head = HtmlPanel(gui, STYLE)
        self._body = HtmlPanel(gui)
        self._wanted: Wanted | None = None
        self._answer: tuple[Wanted, FaceCells | Exception] | None = None
        self._drawn: Wanted | None = None

    def show(self, state: RunState, view: View) -> None:
        if view.selected is None:
            self._head.set(f"{STYLE}<span class='dim'>Click a vertex to see the cells of its faces.</span>")
            self._body.set("")
            self._wanted = self._drawn = None
            return
        faces: list[int] = self._scene.mesh.one_rings[view.selected].tolist()
        if not faces:
            self._head.set(f"{STYLE}<span class='dim'>No face uses vertex {view.selected}.</span>")
            self._body.set("")
            return
        face = view.face if view.face is not None and view.face in faces else faces[0]
        chosen = "".join(
            button(
                str(f),
                self._choose_face(str(f)),
                hint=f"Cells of face {f}",
                css_class="face on" if f == face else "face",
            )
            for f in faces
        )
        self._head.set(f"{STYLE}<div class='row faces'><span class='dim'>Face</span>{chosen}</div>")
        wanted = Wanted(state.run_id, state.moment, face)
        if state.activity is Activity.PAUSED and wanted != self._wanted:
            self._ask(wanted)
            if self._drawn is None:
                self._body.set("<div class='note dim'>Computing the cells…</div>")
        if self._answer is not None and self._answer[0] == wanted and self._drawn != wanted:
            self._drawn = wanted
            self._draw(self._answer[1])

    def _ask(self, wanted: Wanted) -> None:
        self._wanted = wanted

        def question(session: Session) -> FaceCells:
            return face_cells(session, wanted.face, wanted.moment)

        def keep(answer: FaceCells | Exception) -> None:
            self._answer = (wanted, answer)

        self._controller.post(Ask(self, question, keep))

    def _draw(self, cells: FaceCells | Exception) -> None:
        if isinstance(cells, Exception):
            self._body.set(f"<div class='note rejected'>{text(cells)}</div>")
            return
        if not cells.takes_part:
            self._body.set(
                f"<div class='note'>Face {cells.face} takes no part: {len(cells.views)} photos see it well enough, "
                "three are needed.</div>"
            )
            return
        heads = "".join(f"<span style='width:{TILE + 2}px'>{text(kind)}</span>" for kind in KINDS)
        rows = "".join(self._row(cells, row) for row in range(len(cells.views)))
        self._body.set(
            f"{self._facts(cells)}<h4>Basis images</h4>{_basis(cells)}"
            f"<h4>Cells by photo</h4><div class='row kinds'>{heads}</div>{rows}"
        )

    def _facts(self, cells: FaceCells) -> str:
        threshold = (
            f" · outliers beyond e<sub>T</sub> = {number(cells.outlier_threshold, 3)}"
            if np.isfinite(cells.outlier_threshold)
            else ""
        )
        return (
            f"<div class='dim'>{len(cells.views)} photos · {cells.size} × {cells.size} samples · "
            f"k = {len(cells.basis)}</div>"
            f"<div class='dim'>Energy <b>{number(cells.energy)}</b> · σ = {number(cells.sigma, 3)} grey levels"
            f"{threshold}</div>"
        )

    def _row(self, cells: FaceCells, row: int) -> str:
        view_id = int(cells.views[row])
        name = text(self._scene.views[view_id].name)
        seen = f"{100 * float(cells.counts[row].mean()):.0f} % seen"
        energy = number(float(cells.view_energy[row]), 3)
        coefficients = text(" ".join(number(float(value), 3) for value in cells.coefficients[row]))
        return (
            f"<div class='cell' role='button' tabindex='0' title='Look through {name}; c = {coefficients}' "
            f"onclick=\"{text(self._enter(str(view_id)))}\"><div class='row'><span class='grow'>{name}</span>"
            f"<span class='dim'>E {energy} · {seen}</span></div>"
            f"<img src='{strip_of_view(cells, row)}' alt='cells in {name}'></div>"
        )


def _basis(cells: FaceCells) -> str:
    """The basis images and the singular values as bars; those within the eigenspace are bright."""
    values = cells.singular_values
    width, height = 100, TILE
    step = width / max(len(values), 1)
    scale = height / np.log1p(max(float(values[0]), 1e-9))
    bars = []
    for i, value in enumerate(values):
        tall = max(1.0, float(scale * np.log1p(value)))
        color = "#d5d9df" if i < len(cells.basis) else "#59626c"
        bars.append(
            f'<rect x="{i * step:.1f}" y="{height - tall:.1f}" width="{max(step - 1.5, 1):.1f}" height="{tall:.1f}" '
            f'fill="{color}"><title>singular value {i + 1}: {number(float(value))}</title></rect>'
        )
    return (
        f"<div class='row'><img src='{strip_of_basis(cells)}' alt='basis images'>"
        f"<svg viewBox='0 0 {width} {height}' style='width:{width}px;height:{height}px' role='img' "
        f"aria-label='singular values'>{''.join(bars)}</svg></div>"
    )
