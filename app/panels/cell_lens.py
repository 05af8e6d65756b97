"""Lens: one picture of the cells panel enlarged, with its colour scale and the values under the pointer."""

import threading
from collections.abc import Callable

import viser

from app.background_worker import BackgroundWorker
from app.debugger.cell_queries import CellFacts
from app.debugger.run_state import RunState
from app.html import button, icon, text
from app.page_state.cells_controls import CellsControls
from app.page_state.cells_state import ARROW_KINDS, CROP, HEADS, KINDS, PAIR_KINDS, PAIR_PICTURES, PAIR_TIMES
from app.page_state.page_state import PageState
from app.palette import css
from app.panels import camera_box
from app.panels.cell_source import CellSource, chosen_face
from app.panels.choice import chip, photo_link
from app.panels.photo_pages import PhotoPages
from app.pictures.cell_images import FLOW_COLORS, CellPictures, data_uri
from app.query_cache import QueryCache
from app.viser_bridge.floating import CLICK_THROUGH, GAP, MARGIN
from app.viser_bridge.html_panel import HtmlPanel
from app.viser_bridge.view_width import ViewWidth
from fairing.scene import Scene

SIDE = 332  # px of the picture
FRAME = 362  # px of the lens
LEAST_FRAME = 240  # px


class CellLens:
    """Floats beside the cells panel while a picture is enlarged. In a narrow view it leaves room for the camera box."""

    def __init__(
        self,
        gui: viser.GuiApi,
        scene: Scene,
        source: CellSource,
        pages: PhotoPages,
        background: BackgroundWorker,
        controls: CellsControls,
        enter: Callable[[str], str],
        view_width: ViewWidth,
    ) -> None:
        self._scene, self._source, self._controls, self._enter = scene, source, controls, enter
        self._frame = gui.add_panel(visible=False)
        with self._frame.add_tab("Lens", viser.Icon.ZOOM_IN):
            self._panel = HtmlPanel(gui)
        self._frame.float(x=MARGIN, y=MARGIN, width=FRAME)
        self._width = self._width_beside_camera_box = FRAME
        self._has_camera_box = False
        self._fitting = threading.Lock()  # the width of an older view must not overtake that of the newer one
        view_width.subscribe(self._make_room)
        self._pages = pages
        self._drawing: QueryCache[tuple, str] = QueryCache(background.post)
        self._drawn: object = None

    def show(self, state: RunState, page_state: PageState) -> None:
        self._has_camera_box = page_state.entered is not None
        self._fit()
        enlarged = page_state.cells.in_lens
        if enlarged is not None and enlarged[1] in (CROP, *PAIR_KINDS) and page_state.selected is not None:
            self._show_photo(state, page_state, page_state.selected, *enlarged)
            return
        if enlarged is not None:
            self._source.want(state, page_state)
        found = self._source.newest(state, page_state) if enlarged is not None else None
        if enlarged is None or found is None or isinstance(found[1], Exception) or not found[1].cells.takes_part:
            self._set_visible(False)
            return
        key = (found[0], page_state.cells)
        if key != self._drawn:
            self._drawn = key
            self._set(self._content(found[1], *enlarged, page_state), page_state)
        self._set_visible(True)

    def _show_photo(self, state: RunState, page_state: PageState, vertex: int, view_id: int, kind: str) -> None:
        """Show a crop of a photo around the vertex, or a picture of the pair."""
        found = self._pages.newest(state, vertex, page_state.shows("image edges"))
        if found is None:
            return
        key, known = found
        if isinstance(known, Exception):
            return
        cells_view, face = page_state.cells, chosen_face(self._scene.mesh, page_state)
        if kind == CROP or face is None:
            wanted = (key, (view_id, kind), cells_view.span, cells_view.arrow_scale)
            self._drawing.request(wanted, lambda: self._pages.crop(known, view_id, cells_view, SIDE))
        else:
            slot = self._scene.mesh.one_rings[vertex].tolist().index(face)
            affine = state.options.cells.warp == "affine"
            wanted = (key, (face, kind), cells_view.pair)
            self._drawing.request(
                wanted,
                lambda: self._pages.enlarged_pair(known, face, slot, cells_view, affine, kind, SIDE),
            )
        drawn = self._drawing.latest
        if drawn is None or drawn[0][1] != wanted[1]:
            return  # what is drawn so far is another picture
        if (drawn, cells_view.hovered is None) != self._drawn:
            self._drawn = (drawn, cells_view.hovered is None)
            picture = text(drawn[1]) if isinstance(drawn[1], Exception) else drawn[1]
            if kind == CROP:
                content = self._crop_content(vertex, view_id, known.views, picture)
            else:
                content = self._pair_content(kind, picture)
            self._set(content, page_state)
        self._set_visible(True)

    def _make_room(self, view_width: int) -> None:
        self._width_beside_camera_box = max(LEAST_FRAME, min(FRAME, view_width - GAP - camera_box.WIDTH))
        self._fit()

    def _fit(self) -> None:
        with self._fitting:
            width = self._width_beside_camera_box if self._has_camera_box else FRAME
            if width != self._width:
                self._width = width
                self._frame.set_width(width)

    def _set_visible(self, visible: bool) -> None:
        """Show or hide the lens; called after its content is set, so that it never opens on an earlier picture."""
        if self._frame.visible != visible:
            self._frame.visible = visible

    def _set(self, content: str, page_state: PageState) -> None:
        """Show this content. While the pointer rests on the small picture, clicks pass through the lens."""
        is_preview = page_state.cells.hovered is not None
        self._panel.set(f"<div class='{CLICK_THROUGH}'>{content}</div>" if is_preview else content)

    def _crop_content(self, vertex: int, view_id: int, views: list[int], picture: str) -> str:
        go = photo_link(view_id, self._scene.views[view_id].name, self._enter(str(view_id)))
        return (
            f"<div class='row'><span class='grow one'>{go} <span class='dim'>vertex {vertex}</span></span>"
            f"{self._around(views, view_id, CROP)}{self._close_button()}</div><div class='note'>{picture}</div>"
        )

    def _pair_content(self, kind: str, picture: str) -> str:
        close = self._close_button()
        when, shown = kind.split()

        def selector(label: str, other: str) -> str:
            return chip(label, self._controls.lens_of(0, other), f"Enlarge: {label}", other == kind)

        times = "".join(selector(label, f"{other} {shown}") for other, label in PAIR_TIMES.items())
        pictures = "".join(selector(label, f"{when} {other}") for other, label in PAIR_PICTURES.items())
        return (
            f"<div class='row'><span class='grow row chips'>{times}</span>{close}</div>"
            f"<div class='row chips'>{pictures}</div><div class='note'>{picture}</div>"
        )

    def _close_button(self) -> str:
        return button("", self._controls.close, hint="Close the lens", icon=icon("leave"), css_class="small")

    def _around(self, views: list[int], view_id: int, kind: str) -> str:
        """Buttons for the previous and the next photo."""
        at = views.index(view_id) if view_id in views else 0
        return "".join(
            button(
                "",
                self._controls.lens_of(views[(at + step) % len(views)], kind),
                hint=f"{word} photo",
                icon=icon("one", mirrored=step < 0),
                css_class="small",
            )
            for step, word in ((-1, "Previous"), (1, "Next"))
        )

    def _content(self, facts: CellFacts, view_id: int, kind: str, page_state: PageState) -> str:
        cells = facts.cells
        views = cells.views.tolist()
        name = self._scene.views[view_id].name
        close = self._close_button()
        if view_id not in views:
            return (
                f"<div class='row'><span class='grow'>{text(name)} does not see face {cells.face}.</span>{close}</div>"
            )
        row = views.index(view_id)
        pictures = CellPictures(cells, facts.flows)
        go = photo_link(view_id, name, self._enter(str(view_id)))
        kinds = "".join(
            chip(HEADS[other], self._controls.lens_of(view_id, other), KINDS[other], other == kind) for other in KINDS
        )
        arrows = ""
        if kind in ARROW_KINDS:
            path = pictures.arrows(row, kind, SIDE, page_state.cells.arrow_scale)
            arrows = f'<path stroke="{css(FLOW_COLORS[kind])}" style="stroke-width:1.6" d="{path}"/>'
        return (
            f"<div class='row'><span class='grow one'>{go} <span class='dim'>face {cells.face}</span></span>"
            f"{self._around(views, view_id, kind)}{close}</div><div class='row chips'>{kinds}</div>"
            f"<div class='tiles square' style='width:{SIDE}px;cursor:crosshair' "
            f"data-values='{pictures.values(row)}' onpointermove='ef.readOut(event,{cells.size},{pictures.threshold:.4f})'>"
            f"<img class='pixels' src='{data_uri(pictures.picture(row, kind))}' alt='enlarged cell'>"
            f"<svg class='over' viewBox='0 0 {SIDE} {SIDE}'>{arrows}</svg></div>"
            f"<div class='note dim'>{text(KINDS[kind])}</div>"
            f"<div class='read-out'><div>&nbsp;</div></div>{pictures.legend(kind)}"
        )
