"""Camera box: the photo looked through, and how the predicted photo is overlaid on it."""

from collections.abc import Callable

import viser

from app.debugger.run_state import RunState
from app.html import button, icon, photo_title, text
from app.page_state.page_state import PageState
from app.panels.choice import choice
from app.panels.surface_panel import SurfaceControls
from app.viser_bridge.floating import MARGIN
from app.viser_bridge.html_events import HtmlEvents, choice_of, press, whole_number
from app.viser_bridge.html_panel import HtmlPanel
from app.viser_bridge.synced_widget import SyncedSlider
from app.viser_bridge.viser_elements import LABELS_ABOVE
from fairing.scene import Scene

WIDTH = 250  # px
LAID = {False: "Blend", True: "Swipe"}


class CameraBox:
    """Floats in a corner of the 3D view while a camera is looked through.

    The slider sets the share of the model: of every pixel (blend), or of the photo's width (swipe).
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        html_events: HtmlEvents,
        scene: Scene,
        page_state: PageState,
        surface: SurfaceControls,
        leave: Callable[[], None],
        republish: Callable[[], None],
    ) -> None:
        self._scene, self._surface = scene, surface
        self._box = gui.add_panel(visible=False)
        with self._box.add_tab("Camera", viser.Icon.CAMERA):
            self._panel = HtmlPanel(gui)
            share = gui.add_slider(
                "Photo – model", min=0, max=100, step=1, initial_value=round(100 * page_state.model_share),
                hint="Share of the model, in percent: the photo as predicted from the mesh and the other photos.",
            )  # fmt: skip

        def lay(is_swipe: bool) -> None:
            # A swipe from the edge would show nothing new.
            page_state.is_swipe, page_state.model_share = is_swipe, page_state.model_share or 0.5
            republish()

        self._events = html_events.named({"leave": press(leave), "lay": choice_of(lay, lambda: list(LAID), "overlay")})

        def set_share(value: object) -> None:
            page_state.model_share = whole_number(value, 0, 100, "share of the model") / 100
            republish()

        self._followed = SyncedSlider(share, html_events.guarded(set_share))
        self._box.float(x=-MARGIN, y=MARGIN, width=WIDTH)

    def show(self, state: RunState, page_state: PageState) -> None:
        self._box.visible = page_state.entered is not None
        if page_state.entered is None:
            return
        name = photo_title(page_state.entered, self._scene.views[page_state.entered].name)
        back = button("Leave", self._events("leave"), hint="Leave the camera (0)", icon=icon("leave"))
        overlays = {is_swipe: (label, self._events("lay", k)) for k, (is_swipe, label) in enumerate(LAID.items())}
        lay = choice(overlays, page_state.is_swipe, "Overlay")
        self._panel.set(
            f"<div class='{LABELS_ABOVE}'><div class='row'><span class='grow big one'>{text(name)}</span>{back}</div>"
            f"<div class='dim note'>overlay of the model</div>{lay}"
            f"<div class='dim note'>vertices of the model</div>{choice(self._surface.shapes(), page_state.shape, 'Vertices')}</div>"
        )
        self._followed.follow(round(100 * page_state.model_share))
