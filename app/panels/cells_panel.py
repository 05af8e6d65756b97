"""Cells panel: the cells of the selected vertex, crops of the photos around it, and pairs of photos."""

from collections.abc import Callable

import viser

from app.background_worker import BackgroundWorker
from app.debugger.actions import first_keys
from app.debugger.run_state import RunState
from app.html import text
from app.page_state.cells_controls import CellsControls
from app.page_state.cells_state import ITERATION, PANEL_PAGES
from app.page_state.page_state import PageState
from app.panels.cell_source import CellSource, chosen_face
from app.panels.cell_table import cell_table
from app.panels.choice import chip
from app.panels.iteration_page import IterationSource, iteration_page
from app.panels.keys_dialog import key_table
from app.panels.photo_pages import PhotoPages
from app.panels.point_photos import PointPhotos
from app.panels.result_card import ResultCard
from app.query_cache import QueryCache
from app.viser_bridge.html_panel import HtmlPanel
from app.viser_bridge.synced_widget import SyncedSlider
from fairing.scene import Scene

FIRST_MOVES = (
    f"<div class='first'>{key_table(first_keys())}</div>"
    "<div class='dim'>Lessons, beside this tab, explain the method step by step.</div>"
)


class CellsPanel:
    """Buttons for the page and the face, and the chosen page.

    A click on a photo's name looks through its camera; a click on a picture enlarges it.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        scene: Scene,
        source: CellSource,
        iterations: IterationSource,
        pages: PhotoPages,
        point_photos: PointPhotos,
        background: BackgroundWorker,
        controls: CellsControls,
        result: ResultCard,
        choose_face: Callable[[str], str],
        enter: Callable[[str], str],
        guarded: Callable[[Callable[..., None]], Callable[..., None]],
    ) -> None:
        self._scene, self._source, self._pages, self._controls = scene, source, pages, controls
        self._iterations, self._result = iterations, result
        self._choose_face, self._enter, self._point_photos = choose_face, enter, point_photos
        self._head = HtmlPanel(gui)
        self._k = gui.add_slider(
            "k",
            min=1,
            max=2,
            step=1,
            initial_value=1,
            visible=False,
            hint="Eigenspace dimensions of the cells shown here. The run keeps its own k.",
        )
        self._followed = SyncedSlider(self._k, guarded(controls.look_at_k))
        self._body = HtmlPanel(gui)
        self._drawing: QueryCache[tuple, str] = QueryCache(background.post)

    def show(self, state: RunState, page_state: PageState) -> None:
        face = chosen_face(self._scene.mesh, page_state)
        if face is None or page_state.selected is None:
            note = "Select a vertex to see the cells of its faces."
            if page_state.selected is not None:
                note = f"No face uses vertex {page_state.selected}."
            self._k.visible = False
            self._show_point(state, page_state, note)
            return
        if page_state.cells.page == "cells":
            moment = self._show_cells(state, page_state)
        elif page_state.cells.page == ITERATION:
            moment = self._show_iteration(state, page_state, page_state.selected, face)
        else:
            moment = self._show_photos(state, page_state, page_state.selected, face)
        self._head.set(self._choices(page_state, page_state.selected, face) + stale_note(state, moment))

    def _choices(self, page_state: PageState, vertex: int, face: int) -> str:
        faces = "".join(
            chip(str(f), self._choose_face(str(f)), f"Cells of face {f}", f == face, "face")
            for f in self._scene.mesh.one_rings[vertex].tolist()
        )
        pages = "".join(
            chip(title, self._controls.page(str(n)), f"Page: {title}", page == page_state.cells.page)
            for n, (page, title) in enumerate(PANEL_PAGES.items())
        )
        return f"<div class='row chips pages'>{pages}</div><div class='row faces'><span class='dim'>Face</span>{faces}</div>"

    def _show_cells(self, state: RunState, page_state: PageState) -> int | None:
        """Show the cells; returns the moment that they belong to, None without any."""
        self._source.want(state, page_state)
        found = self._source.newest(state, page_state)
        if found is None:
            waits = "Computing the cells…" if not state.is_moving else "The cells are computed when the run pauses."
            self._body.set(f"<div class='note dim'>{waits}</div>")
            self._k.visible = False
            return None
        question, facts = found
        if isinstance(facts, Exception):
            self._body.set(f"<div class='note rejected'>{text(facts)}</div>")
            return None
        self._show_k(page_state.cells.dimensions or facts.own_dimensions, len(facts.energies))
        cells_view = page_state.cells
        self._draw(
            ("cells", question, cells_view.columns, cells_view.arrow_scale),
            lambda: cell_table(facts, cells_view, self._scene, self._controls, self._enter),
        )
        return question.moment

    def _show_iteration(self, state: RunState, page_state: PageState, vertex: int, face: int) -> int | None:
        """Show a part of the iteration; returns the moment that it belongs to, None without one."""
        self._k.visible = False
        found = self._iterations.newest(state, vertex, face)
        if found is None:
            waits = "Computing the step…" if not state.is_moving else "The step is computed when the run pauses."
            self._body.set(f"<div class='note dim'>{waits}</div>")
            return None
        question, facts = found
        if isinstance(facts, Exception):
            self._body.set(f"<div class='note rejected'>{text(facts)}</div>")
            return None
        options, scene, controls = state.options, self._scene, self._controls
        self._draw(
            (ITERATION, question, page_state.cells.part),
            lambda: iteration_page(facts, options, page_state, scene, controls, self._enter),
        )
        return question.moment

    def _show_photos(self, state: RunState, page_state: PageState, vertex: int, face: int) -> int | None:
        """Show a page of photos; returns the moment that it belongs to, None without one."""
        self._k.visible = False
        found = self._pages.newest(state, vertex, page_state.shows("image edges"))
        if found is None:
            self._body.set("<div class='note dim'>Cropping the photos…</div>")
            return None
        key, known = found
        if isinstance(known, Exception):
            self._body.set(f"<div class='note rejected'>{text(known)}</div>")
            return None
        cells_view, pages = page_state.cells, self._pages
        if cells_view.page == "photos":
            self._draw(("photos", key, cells_view.span, cells_view.arrow_scale), lambda: pages.crops(known, cells_view))
            return key[1]
        slot = self._scene.mesh.one_rings[vertex].tolist().index(face)
        affine = state.options.cells.warp == "affine"
        self._draw(("pair", key, face, cells_view.pair), lambda: pages.pair(known, face, slot, cells_view, affine))
        return key[1]

    def _show_point(self, state: RunState, page_state: PageState, note: str) -> None:
        """The selected sparse point in its photos; without one, the result of a finished run, or a note and the first keys."""
        point, points, pictures = page_state.point, self._scene.sparse_points, self._point_photos
        self._head.set("" if point is not None else f"<span class='dim'>{note}</span>")
        if point is None or points is None:
            self._body.set(self._result.markup(state, page_state) or FIRST_MOVES)
            return
        self._draw(("point", point), lambda: pictures.draw(points, point))

    def _draw(self, key: tuple, work: Callable[[], str]) -> None:
        """Show a page drawn in the background. Until it is ready, the previous drawing of the same page stays."""
        self._drawing.request(key, work)
        if self._drawing.latest is not None and self._drawing.latest[0][0] == key[0]:
            drawn = self._drawing.latest[1]
            self._body.set(f"<div class='note rejected'>{text(drawn)}</div>" if isinstance(drawn, Exception) else drawn)

    def _show_k(self, k: int, largest: int) -> None:
        self._k.visible = largest > 1
        if largest > 1:
            if self._k.max != largest:
                self._k.max = largest
            self._followed.follow(min(k, largest))


def stale_note(state: RunState, moment: int | None) -> str:
    """Markup that names the moment of what is shown where it is not the present one; else a blank line of its height."""
    if moment is None or moment == state.moment:
        return "<div class='note'>&nbsp;</div>"
    when = "it follows when the run pauses" if state.is_moving else "the present one is being computed"
    return f"<div class='note selected stale'>Shows moment {moment}; {when}.</div>"
