"""Cameras panel: the found lens, the correction of each photo's camera, its reprojection error before and after, and the steps
between."""

from collections.abc import Callable

import viser

from app.debugger.run_state import RunState
from app.html import text
from app.page_state.page_state import MAX_MAGNIFICATION, PageState
from app.panels.choice import photo_link
from app.panels.lens_table import lens_table
from app.viser_bridge.html_events import HtmlEvents, whole_number
from app.viser_bridge.html_panel import HtmlPanel
from app.viser_bridge.synced_widget import SyncedSlider
from fairing.run.recorded_refinement import RecordedRefinement
from fairing.scene import Scene


class CamerasPanel:
    """A table with a row for each photo, a slider through the iterations of the adjustment, and the lens where it was refined."""

    def __init__(
        self,
        gui: viser.GuiApi,
        html_events: HtmlEvents,
        scene: Scene,
        refinement: RecordedRefinement,
        page_state: PageState,
        enter: Callable[[str], str],
        republish: Callable[[], None],
    ) -> None:
        self._scene, self._refinement, self._enter = scene, refinement, enter

        def choose(value: object) -> None:
            page_state.adjustment_step = whole_number(value, 0, len(refinement) - 1, "step")
            republish()

        def magnify(value: object) -> None:
            page_state.magnification = whole_number(value, 1, MAX_MAGNIFICATION, "magnification")
            republish()

        self._head = HtmlPanel(gui)
        step = gui.add_slider(
            "Step", min=0, max=max(len(refinement) - 1, 1), step=1, initial_value=page_state.adjustment_step,
            hint="Pale frusta show the cameras after this step of the adjustment; step 0: as given.",
        )  # fmt: skip
        magnification = gui.add_slider(
            "Magnify", min=1, max=MAX_MAGNIFICATION, step=1, initial_value=round(page_state.magnification),
            hint="Pale frusta are drawn this many times farther from the corrected cameras.",
        )  # fmt: skip
        self._followed = SyncedSlider(step, html_events.guarded(choose))
        self._magnified = SyncedSlider(magnification, html_events.guarded(magnify))
        self._table = HtmlPanel(gui)
        self._lens = lens_table(scene.views, refinement.given)

    def show(self, state: RunState, page_state: PageState) -> None:
        found, step = self._refinement, min(page_state.adjustment_step, len(self._refinement) - 1)
        self._head.set(f"<div class='note'>{text(found.reason[:1].upper() + found.reason[1:])}.</div>{self._lens}")
        self._followed.follow(step)
        self._magnified.follow(round(page_state.magnification))
        rows = "".join(
            f"<tr><td class='one'>{photo_link(v, view.name, self._enter(str(v)))}</td>"
            f"<td class='n'>{found.corrections[v]:.2f}</td>"
            f"<td class='n'>{found.errors[step, v]:.2f}</td><td class='n'>{found.errors[-1, v]:.2f}</td></tr>"
            for v, view in enumerate(self._scene.views)
        )
        at = "given" if step == 0 else f"step {step}"
        self._table.set(
            "<table class='photos'><tr><th>Photo</th><th class='n'>Correction, px</th>"
            f"<th class='n'>Error {at}, px</th><th class='n'>corrected</th></tr>{rows}</table>"
        )
