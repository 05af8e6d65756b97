"""While a camera is looked through: which one, and how the model is laid over its photo."""

from collections.abc import Callable

import viser

from app.debugger.run_state import RunState
from app.html import button, icon, text
from app.page_state.page_state import PageState
from app.panels.choice import choice
from app.panels.surface_panel import SHAPES, SurfaceButtons
from app.viser_bridge.floating import MARGIN
from app.viser_bridge.html_events import Bridge, whole_number
from app.viser_bridge.html_panel import HtmlPanel
from app.viser_bridge.synced_widget import Followed
from fairing.scene import Scene

WIDTH = 300
LAID = {False: "Blend", True: "Swipe"}


class CameraButtons:
    """JavaScript for the box's buttons, made where it stays on the page when the box is not."""

    def __init__(
        self, bridge: Bridge, view: PageState, leave: Callable[[], None], republish: Callable[[], None]
    ) -> None:
        def lay(swipes: bool) -> None:
            # A swipe from the edge would show nothing new.
            view.swipes, view.model_share = swipes, view.model_share or 0.5
            republish()

        self.leave = bridge.button(leave)
        self.lay = {swipes: bridge.button(lambda swipes=swipes: lay(swipes)) for swipes in LAID}


class CameraBox:
    """Floats in a corner of the 3D view. Blend: the slider is the model's share of every pixel; swipe: of the width."""

    def __init__(
        self,
        gui: viser.GuiApi,
        scene: Scene,
        page_state: PageState,
        press: CameraButtons,
        surface: SurfaceButtons,
        guarded: Callable[[Callable[..., None]], Callable[..., None]],
        republish: Callable[[], None],
    ) -> None:
        self._scene, self._press, self._surface = scene, press, surface
        self._box = gui.add_panel(visible=False)
        with self._box.add_tab("Camera", viser.Icon.CAMERA):
            self._panel = HtmlPanel(gui)
            share = gui.add_slider(
                "Photo – model", min=0, max=100, step=1, initial_value=round(100 * page_state.model_share),
                hint="Lays what the other photos and the mesh predict over the photo (%).",
            )  # fmt: skip

        def set_share(value: object) -> None:
            page_state.model_share = whole_number(value, 0, 100, "share of the model") / 100
            republish()

        self._followed = Followed(share, guarded(set_share))
        self._box.float(x=-MARGIN, y=MARGIN, width=WIDTH)

    def show(self, state: RunState, page_state: PageState) -> None:
        self._box.visible = page_state.entered is not None
        if page_state.entered is None:
            return
        name = self._scene.views[page_state.entered].name
        back = button("Leave", self._press.leave, hint="Leave the camera (0)", icon=icon("leave"))
        lay = choice(
            {swipes: (LAID[swipes], js) for swipes, js in self._press.lay.items()}, page_state.swipes, "Lay over"
        )
        shapes = {shape: (SHAPES[shape], js) for shape, js in self._surface.press_shape.items()}
        self._panel.set(
            f"<div class='row'>{icon('eye')}<span class='grow big one'>{text(name)}</span>{back}</div>"
            f"<div class='dim note'>the model over the photo</div>{lay}"
            f"<div class='dim note'>with the mesh as it is</div>{choice(shapes, page_state.shape, 'Model')}"
        )
        self._followed.follow(round(100 * page_state.model_share))
