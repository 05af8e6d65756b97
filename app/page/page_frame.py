"""Page frame: what every page of one browser has, of the debugger and of flip records alike."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import viser

from app.html import STYLE
from app.page.page_camera import PageCamera
from app.stage import Stage
from app.viser_bridge import floating
from app.viser_bridge.error_toasts import ErrorToasts
from app.viser_bridge.hotkeys import add_hotkey
from app.viser_bridge.html_events import HtmlEvents
from app.viser_bridge.in_place import update_in_place
from app.viser_bridge.keyboard_focus import release_focus_after_use
from app.viser_bridge.opening_page import HIDDEN
from app.viser_bridge.style_sheet import set_style_sheet
from app.viser_bridge.timeline_placement import TimelinePlacement
from fairing.scene import Scene


@dataclass(frozen=True)
class Hotkey:
    """An entry of the command palette.

    Attributes:
        key: None for an entry without a key.
        modifier: "shift" and the like.
    """

    label: str
    call: Callable[[], None]
    key: str | None = None
    modifier: str | None = None


class PageFrame:
    """Attributes:
    toasts: wraps callbacks so that their exceptions are shown.
    html_events: events of the HTML panels.
    camera: the browser's camera.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        title: str,
        stage: Stage,
        scene: Scene,
        on_camera: Callable[[int | None], None],
        on_prediction: Callable[[], None],
    ) -> None:
        self._client, self._scene = client, scene
        self.toasts = ErrorToasts(client)
        client.gui.set_panel_label(f"EigenFairing · {title}")
        self.html_events = HtmlEvents(client.gui, self.toasts)
        self.camera = PageCamera(client, stage, scene, self.toasts, on_camera, on_prediction)

    def finish(self, timeline: viser.PanelHandle, css: str = "") -> None:
        """After all panels have been added: place the timeline, and install the page's style sheet and scripts."""
        TimelinePlacement(self._client.gui, timeline, self.html_events)
        set_style_sheet(self._client, STYLE + floating.STYLE + css + self.html_events.style + HIDDEN)
        release_focus_after_use(self._client)
        update_in_place(self._client)

    def add_hotkeys(self, hotkeys: Iterable[Hotkey]) -> None:
        for hotkey in hotkeys:
            call = self.toasts.without_event(hotkey.call)
            add_hotkey(self._client, hotkey.label, call, hotkey.key, hotkey.modifier)

    def camera_hotkeys(self) -> list[Hotkey]:
        """The hotkeys of the camera and the theme."""
        camera = self.camera
        entering = [
            Hotkey(f"Look through camera {view.name}", lambda k=k: camera.enter(k), str(k + 1))
            for k, view in enumerate(self._scene.views[:9])
        ]
        return [
            *entering,
            Hotkey("Leave the camera", camera.leave, "0"),
            Hotkey("Show the mesh", camera.show_mesh, "M"),
            Hotkey("Show mesh and cameras", camera.show_mesh_and_cameras, "V"),
            Hotkey("Dark or light", camera.switch_theme, "Y"),
        ]

    def close(self) -> None:
        """The browser has disconnected."""
        self.camera.close()
