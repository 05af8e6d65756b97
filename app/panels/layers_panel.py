"""What of the scene is drawn."""

import viser

from app.debugger.run_state import RunState
from app.html import button, text
from app.page_state.page_state import LAYERS, PageState
from app.palette import CAMERA, NOW, POINTS, RGB, SELECTED, START, TRUTH, solid
from app.viser_bridge.html_panel import HtmlPanel
from fairing.scene import Scene

SWATCHES: dict[str, RGB] = {
    "now": NOW,
    "start": START,
    "truth": TRUTH,
    "vertices": SELECTED,
    "paths": NOW,
    "certainty": SELECTED,
    "cameras": CAMERA,
    "points": POINTS,
}


def available_layers(scene: Scene) -> list[str]:
    """The layers that this scene has something for."""
    missing = {"truth": scene.truth is None, "points": scene.sparse_points is None}
    return [name for name in LAYERS if not missing.get(name, False)]


class LayersPanel:
    """A switch a layer; its colour is the one in the scene."""

    def __init__(self, gui: viser.GuiApi, press: dict[str, str], switch_theme: str) -> None:
        self._press = press
        self._theme = button("Dark or light", switch_theme, hint="Dark or light (Y)", css_class="wide")
        self._panel = HtmlPanel(gui)

    def show(self, state: RunState, page_state: PageState) -> None:
        switches = "".join(self._switch(name, page_state.shows(name)) for name in self._press)
        self._panel.set(f"<div class='layers'>{switches}</div><h4>Theme</h4>{self._theme}")

    def _switch(self, name: str, is_on: bool) -> str:
        swatch = f'<span class="swatch" style="background:{solid(SWATCHES[name])}"></span>'
        hint = f"{'Hide' if is_on else 'Show'} {LAYERS[name].lower()}"
        switch = button(
            LAYERS[name], self._press[name], hint=hint, icon=swatch, css_class="layer" if is_on else "layer off"
        )
        return switch.replace("<button", f'<button aria-pressed="{text(str(is_on).lower())}"', 1)
