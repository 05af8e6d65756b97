"""The part of a page that shows moments before the flips: drawing, section, and the selected tetrahedron."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import viser

from app.flips.carving_layers import CarvingLayers
from app.flips.carving_panels import carving_facts, carving_legend, section_choice, tetrahedron_terms
from app.flips.drawing import Draughtsman, Drawing
from app.flips.section import DIRECTIONS, Section
from app.flips.story import Chapter, Story
from app.flips.votes import VoteCounter
from app.picking import first_hit
from app.stage import Stage
from app.viser_bridge.html_events import Events, Handler, choice_of, integer, press, whole_number
from fairing.triangulation import Carving

SECTIONED = (Chapter.TETRAHEDRA, Chapter.RAYS, Chapter.CUT)
PICKABLE = (*SECTIONED, Chapter.SEEN)


class CarvingView:
    """What one browser sees of a carving.

    Args:
        show: called where it changes.
        look_along: moves the browser's camera, see `PageCamera.look_along`.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        stage: Stage,
        story: Story,
        carving: Carving,
        show: Callable[[], None],
        look_along: Callable[[np.ndarray], None],
    ) -> None:
        self._story, self._carving, self._stage, self._show = story, carving, stage, show
        self._look_along = look_along
        self._votes = VoteCounter(carving)
        self._draughtsman = Draughtsman(story, carving, stage, self._votes)
        self._layers = CarvingLayers(client, stage, carving, self._draughtsman)
        self.section = Section()
        self._selected: int | None = None
        self._drawn: tuple[int, Section] | None = None
        self._drawing = Drawing()
        self._crossing: tuple[tuple[int, int], np.ndarray] = (-1, -1), np.zeros(0, dtype=int)

    def handlers(self) -> dict[str, Handler]:
        """Handlers of the events of its panels."""
        last = len(self._carving.is_outside) - 1
        return {
            "section": choice_of(self._set_direction, lambda: list(DIRECTIONS), "section"),
            "tetrahedron": integer(self._select, "tetrahedron", 0, last),
            "deselect": press(lambda: self._select(None)),
        }

    def is_sectioned(self, moment: int) -> bool:
        """Whether the section has an effect at a moment."""
        extent, k = self._story.at(moment)
        return extent.chapter in SECTIONED and not (extent.chapter is Chapter.CUT and k == 1)

    def fill(self, moment: int, *, outside: bool) -> None:
        """Draw a moment; its meshes are hidden while a photo is looked through."""
        if not self._story.is_carving(moment):
            self._layers.show(None)
            self._layers.select(None, np.zeros(0, dtype=int))
            self._drawn = None
            return
        if self._drawn != (moment, self.section):
            self._drawn, self._drawing = (moment, self.section), self._draughtsman.draw(moment, self.section)
        light = self.section.seen_from(self._stage)
        self._layers.show(self._drawing if outside else replace(self._drawing, meshes={}), light)
        chapter = self._story.at(moment)[0].chapter
        selected = self._selected if outside and chapter in PICKABLE else None
        self._layers.select(selected, self._lines_through(moment))

    def facts(self, moment: int) -> str:
        """Markup of what the moment shows."""
        return carving_facts(self._story, moment, self._drawing)

    def legend(self, moment: int, events: Events) -> str:
        """Markup of the legend and the choice of the section."""
        legend = carving_legend(self._drawing)
        return legend + section_choice(self.section, events) if self.is_sectioned(moment) else legend

    def terms(self, moment: int, events: Events) -> str:
        """Markup of the terms of the selected tetrahedron."""
        chapter = self._story.at(moment)[0].chapter
        if chapter not in PICKABLE:
            return ""
        sums, is_cut = self._votes.after(self._n_photos(moment)), chapter in (Chapter.CUT, Chapter.SEEN)
        n_lines = len(self._lines_through(moment))
        return tetrahedron_terms(self._carving, self._selected, sums, n_lines, is_cut=is_cut, events=events)

    def click(self, event: viser.SceneClickEvent) -> None:
        """Select the tetrahedron under the pointer, or none."""
        shown = self._drawing.tetrahedra
        hit = first_hit(shown.corners, np.array(event.ray_origin), np.array(event.ray_direction))
        self._select(None if hit is None else int(shown.tetrahedra[hit]))

    def move_section(self, depth: object) -> None:
        """Put the section at a depth, percent, sent by a browser."""
        self.section = replace(self.section, depth=whole_number(depth, -100, 100, "section"))
        self._show()

    def _set_direction(self, direction: str) -> None:
        self.section = replace(self.section, direction=direction)
        if direction != "off":
            self._look_along(self.section.seen_from(self._stage))
        self._show()

    def _select(self, tetrahedron: int | None) -> None:
        self._selected = tetrahedron
        self._show()

    def _n_photos(self, moment: int) -> int:
        """Number of photos whose rays have been seen by then."""
        extent, k = self._story.at(moment)
        if extent.chapter is Chapter.RAYS:
            return k + 1
        return 0 if extent.chapter in (Chapter.POINTS, Chapter.TETRAHEDRA) else len(self._carving.photos)

    def _lines_through(self, moment: int) -> np.ndarray:
        if self._selected is None:
            return np.zeros(0, dtype=int)
        wanted = self._selected, self._n_photos(moment)
        if self._crossing[0] != wanted:
            self._crossing = wanted, self._carving.lines_through(wanted[0], range(wanted[1]))
        return self._crossing[1]
