"""Box panel: choose the box whose points become vertices, by dragging its corners in the 3D view or by numbers."""

from collections.abc import Callable

import viser

from app.debugger.run_state import RunState
from app.html import button, copy_button
from app.page_state.page_state import PageState
from app.viser_bridge.html_events import HtmlEvents, press
from app.viser_bridge.html_panel import HtmlPanel
from app.viser_bridge.text_field import TextField
from fairing.errors import InputError
from fairing.scene import BoxCorners, Scene
from fairing.triangulation.object_box import box_of_corners
from fairing.triangulation.points_in_box import box_words, check_corners

FLAG = "--box"


class BoxPanel:
    """A switch for the box, its corners as the option of a command, and the number of points in it.

    A mesh of the points in another box is another run's: its vertices, faces and everything recorded differ. So the panel gives the
    option, and leaves the run of the page as it is.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        html_events: HtmlEvents,
        scene: Scene,
        page_state: PageState,
        republish: Callable[[], None],
    ) -> None:
        self._positions, self._first = scene.sparse_positions, first_box(scene)

        def toggle() -> None:
            page_state.box = self._first if page_state.box is None else None
            republish()

        def type_in(line: str) -> None:
            page_state.box = corners_of(line)
            republish()

        self._events = html_events.named({"toggle": press(toggle)})
        self._head = HtmlPanel(gui, "<h4>Box of the mesh</h4>")
        self._field = TextField(
            gui, html_events, "Box", "Corners x0 y0 z0 x1 y1 z1, world units; Enter shows the box", type_in, keeps=True
        )
        self._panel = HtmlPanel(gui)

    def show(self, state: RunState, page_state: PageState) -> None:
        words = "" if page_state.box is None else box_words(page_state.box)
        self._field.write(words.removeprefix(FLAG).strip())
        switch = button(
            "Choose another box" if page_state.box is None else "Hide the box",
            self._events("toggle"),
            hint="A run that is started with another box covers the points in it alone",
            css_class="wide",
        )
        if page_state.box is None:
            self._panel.set(switch)
            return
        count = int(box_of_corners(page_state.box).contains(self._positions).sum())
        copy = copy_button(words, "Copy the option")
        self._panel.set(
            f"{switch}<div class='note'>{count} of {len(self._positions)} sparse points are in the box. Drag its corners, then "
            f"start again with this option:</div><div class='note'><code>{words}</code> {copy}</div>"
        )


def first_box(scene: Scene) -> BoxCorners:
    """The box to begin with: around the object's box, or around the mesh."""
    vertices, box = scene.mesh.vertices, scene.object_box
    low, high = (vertices.min(axis=0), vertices.max(axis=0)) if box is None else box.bounds
    (x0, y0, z0), (x1, y1, z1) = low.tolist(), high.tolist()
    return x0, y0, z0, x1, y1, z1


def corners_of(line: str) -> BoxCorners:
    """The corners of a box that a user typed.

    Raises:
        InputError: they are no corners of a box.
    """
    words = line.strip().removeprefix(FLAG).replace(",", " ").split()
    try:
        x0, y0, z0, x1, y1, z1 = (float(word) for word in words)
    except ValueError:
        raise InputError(f"box: expected six numbers x0 y0 z0 x1 y1 z1, found {line.strip() or 'none'}") from None
    corners = (x0, y0, z0, x1, y1, z1)
    check_corners(corners)
    return corners
