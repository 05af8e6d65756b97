"""Page frame: what every page of one browser has, of the debugger and of flip records alike."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import viser

from app.debugger.actions import KEY_LABELS
from app.html import STYLE, photo_title
from app.keys import Key
from app.page.page_camera import PageCamera
from app.stage import Stage
from app.viser_bridge import floating, viser_elements
from app.viser_bridge.accessible_names import name_widgets
from app.viser_bridge.completion import complete_names
from app.viser_bridge.drawn_elements import define_elements
from app.viser_bridge.error_toasts import ErrorToasts
from app.viser_bridge.hotkeys import add_hotkey, handle_keys
from app.viser_bridge.html_events import HtmlEvents
from app.viser_bridge.in_place import update_in_place
from app.viser_bridge.keyboard_focus import release_focus_after_use
from app.viser_bridge.opening_page import HIDDEN
from app.viser_bridge.split_view import DIVIDER_STYLE
from app.viser_bridge.style_sheet import set_style_sheet
from app.viser_bridge.tabs import set_tab_title
from app.viser_bridge.view_overlay import OVERLAY_STYLE
from app.viser_bridge.view_width import ViewWidth, span_bottom
from fairing.scene import Scene


@dataclass(frozen=True)
class Hotkey:
    """An entry of the command palette.

    Attributes:
        key, modifier: the first key, None for an entry without a key; the modifier is "shift" and the like.
        other_keys: further keys for the same entry.
    """

    label: str
    call: Callable[[], None]
    key: str | None = None
    modifier: str | None = None
    other_keys: tuple[Key, ...] = ()


class PageFrame:
    """Attributes:
    toasts: wraps callbacks so that their exceptions are shown.
    html_events: events of the HTML panels.
    view_width: width of the 3D view.
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
        self._entries: list[tuple[Hotkey, viser.CommandHandle]] = []
        self.toasts = ErrorToasts(client)
        client.gui.set_panel_label(f"EigenFairing · {title}")
        set_tab_title(client, f"EigenFairing - {title}")
        self.html_events = HtmlEvents(client.gui, self.toasts)
        self.view_width = ViewWidth(self.html_events)
        self.camera = PageCamera(client, stage, scene, self.toasts, on_camera, on_prediction)

    def finish(self, timeline: viser.PanelHandle, css: str = "") -> None:
        """After all panels have been added: place the timeline, and install the page's style sheet and scripts."""
        span_bottom(timeline, self.view_width)
        self.view_width.measure(self._client.gui)
        css = viser_elements.STYLE + STYLE + floating.STYLE + css + OVERLAY_STYLE + DIVIDER_STYLE + HIDDEN
        set_style_sheet(self._client, css)
        release_focus_after_use(self._client)
        update_in_place(self._client)
        complete_names(self._client)
        name_widgets(self._client)
        define_elements(self._client)

    def add_hotkeys(self, hotkeys: Iterable[Hotkey]) -> None:
        """Add them, once."""
        further: list[tuple[str, dict[str, object]]] = []
        for hotkey in hotkeys:
            keys = () if hotkey.key is None else ((hotkey.key, hotkey.modifier), *hotkey.other_keys)
            entry, others = add_hotkey(self._client, hotkey.label, self.toasts.without_event(hotkey.call), keys)
            self._entries.append((hotkey, entry))
            further += others
        handle_keys(self._client, further)

    def rename_hotkeys(self, label_of: Callable[[str], str]) -> None:
        """Give the entries of the palette other labels, from those they were added with."""
        for hotkey, entry in self._entries:
            label = label_of(hotkey.label)
            if entry.label != label:
                entry.label = label

    def camera_hotkeys(self) -> list[Hotkey]:
        """The hotkeys of the camera and the theme."""
        camera = self.camera
        entering = [
            Hotkey(f"Look through photo {photo_title(k, view.name)}", lambda k=k: camera.enter(k), str(k + 1))
            for k, view in enumerate(self._scene.views[:9])
        ]
        return [
            *entering,
            Hotkey(KEY_LABELS["0"], camera.leave, "0"),
            Hotkey(KEY_LABELS["M"], camera.show_mesh, "M"),
            Hotkey(KEY_LABELS["V"], camera.show_mesh_and_cameras, "V"),
            Hotkey(KEY_LABELS["Shift+F"], camera.show_front, "F", "shift"),
            Hotkey(KEY_LABELS["Shift+T"], camera.show_top, "T", "shift"),
            Hotkey(KEY_LABELS["Y"], camera.switch_theme, "Y"),
        ]

    def close(self) -> None:
        """The browser has disconnected."""
        self.camera.close()
