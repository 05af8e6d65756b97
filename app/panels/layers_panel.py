"""Layers panel: switches for the layers of the 3D view and for the theme."""

from collections.abc import Callable

import viser

from app.debugger.run_state import RunState
from app.html import button
from app.page_state.association_source import OF_PHOTO
from app.page_state.page_state import LAYERS, MAX_MAGNIFICATION, PageState
from app.palette import AXIS_COLORS, CAMERA, GHOST, NOW, POINTS, SEEN, SELECTED, START, TERM_COLORS, TRUTH, solid
from app.panels.legend import PATH
from app.pictures.term_colors import COLOR_OF_TERM
from app.viser_bridge.html_events import HtmlEvents, choice_of, press, whole_number
from app.viser_bridge.html_panel import HtmlPanel
from app.viser_bridge.synced_widget import on_user_change
from fairing.scene import Scene
from fairing.terms.names import IMAGE_EDGES
from fairing.terms.names import POINTS as POINTS_TERM

SWATCHES: dict[str, str] = {
    "now": solid(NOW),
    "start": solid(START),
    "truth": solid(TRUTH),
    "vertices": f"linear-gradient(90deg,{solid(START)} 50%,{solid(NOW)} 50%)",
    "paths": PATH,
    "certainty": solid(SELECTED),
    "cameras": solid(CAMERA),
    "given cameras": solid(GHOST),
    "points": solid(POINTS),
    "object box": solid(GHOST),
    "pulls": f"linear-gradient(90deg,{solid(TERM_COLORS[0])} 50%,{solid(TERM_COLORS[1])} 50%)",
    "point feet": solid(COLOR_OF_TERM[POINTS_TERM]),
    "image edges": solid(COLOR_OF_TERM[IMAGE_EDGES]),
    "axes": f"linear-gradient(90deg,{','.join(f'{solid(c)} {33 * k}% {33 * k + 33}%' for k, c in enumerate(AXIS_COLORS))})",
    "seen": solid(SEEN),
}
"""CSS backgrounds in the colours of the layers: vertices are green or red, paths run from green to red, every term has its own."""


_ENTER = "Look through a camera to see its image edges and what it sees."


def available_layers(scene: Scene) -> list[str]:
    """Names of the layers for which the scene has data."""
    has_no_points = scene.sparse_points is None
    missing = {
        "truth": scene.truth is None,
        "points": has_no_points,
        "point feet": has_no_points,
        "given cameras": scene.given_cameras is None,
        "object box": scene.object_box is None,
    }
    return [name for name in LAYERS if not missing.get(name, False)]


class LayersPanel:
    """One switch per layer, with the colour that the layer has in the 3D view."""

    def __init__(
        self,
        gui: viser.GuiApi,
        html_events: HtmlEvents,
        scene: Scene,
        page_state: PageState,
        switch_theme: Callable[[], None],
        switch_layout: Callable[[], None],
        republish: Callable[[], None],
    ) -> None:
        self._names = available_layers(scene)

        def toggle(name: str) -> None:
            page_state.shown[name] = not page_state.shown[name]
            republish()

        def magnify(value: object) -> None:
            page_state.magnification = whole_number(value, 1, MAX_MAGNIFICATION, "magnification")
            republish()

        self._events = html_events.named(
            {
                "toggle": choice_of(toggle, lambda: self._names, "layer"),
                "theme": press(switch_theme),
                "layout": press(switch_layout),
            }
        )
        self._theme = button("Dark or light", self._events("theme"), hint="Dark or light (Y)", css_class="wide")
        self._layout = button(
            "Presenter layout",
            self._events("layout"),
            hint="Large text and pictures at the left, the step buttons at the right (Shift+P)",
            css_class="wide",
        )
        self._panel = HtmlPanel(gui)
        slider = gui.add_slider(
            "Magnify paths",
            min=1,
            max=MAX_MAGNIFICATION,
            step=1,
            initial_value=page_state.magnification,
            hint="Displacements are drawn this many times longer, about the present positions of the vertices.",
        )
        on_user_change(slider, html_events.guarded(magnify))

    def show(self, state: RunState, page_state: PageState) -> None:
        switches = "".join(self._switch(k, name, page_state.shows(name)) for k, name in enumerate(self._names))
        waits = any(page_state.shows(layer) for layer in OF_PHOTO) and page_state.entered is None
        note = f"<div class='dim note'>{_ENTER}</div>" if waits else ""
        self._panel.set(
            f"<div class='layers'>{switches}</div>{note}<h4>Theme and layout</h4>"
            f"<div class='stack'>{self._theme}{self._layout}</div>"
        )

    def _switch(self, k: int, name: str, is_on: bool) -> str:
        swatch = f'<span class="swatch" style="background:{SWATCHES[name]}"></span>'
        hint = f"{'Hide' if is_on else 'Show'} {LAYERS[name].lower()}"
        return button(
            LAYERS[name],
            self._events("toggle", k),
            hint=hint,
            icon=swatch,
            css_class="layer" if is_on else "layer off",
            pressed=is_on,
        )
