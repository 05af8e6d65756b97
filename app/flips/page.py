"""The page of a record of flips, and the server of such pages."""

import logging
import threading
from collections.abc import Callable
from typing import Any

import numpy as np
import viser

from app.background_worker import BackgroundWorker
from app.flips.film import FlipFilm
from app.flips.panels import SPEEDS, Presses, buttons, energy_plot, facts, legend, strip
from app.flips.player import Player
from app.flips.scene_layers import FlipLayers
from app.html import STYLE, button, icon, text
from app.layers.cameras import CamerasLayer, Thumbnails
from app.page.camera_view import CameraView
from app.panels.choice import choice
from app.stage import FIELD_OF_VIEW, Stage
from app.viser_bridge.error_toasts import Guard
from app.viser_bridge.html_events import Bridge, whole_number
from app.viser_bridge.html_panel import HtmlPanel
from app.viser_bridge.in_place import change_in_place
from app.viser_bridge.keyboard_focus import release_focus_after_use
from app.viser_bridge.style_sheet import lay_style_sheet
from app.viser_bridge.synced_widget import Followed
from app.viser_bridge.theme import Theme
from app.viser_bridge.timeline_placement import TimelinePlace
from app.viser_bridge.viewer import address_of, stop_viewer
from fairing.scene import Scene
from fairing.triangulation import FlipTrace


class FlipPage:
    """Of one browser: every browser has a moment of its own."""

    def __init__(
        self, client: viser.ClientHandle, scene: Scene, stage: Stage, film: FlipFilm, thumbnails: Thumbnails,
        painter: BackgroundWorker,
    ) -> None:  # fmt: skip
        self._client, self._scene, self._stage, self._film = client, scene, stage, film
        self._guard = Guard(client)
        self._player = Player(len(film), SPEEDS[1], self.show)
        self._is_textured = True
        self._showing = threading.RLock()  # a play and a click may come at the same time
        self._theme = Theme(client)
        self._look_through = CameraView(client, stage, scene, self._theme, self.show)
        client.gui.set_panel_label(f"EigenFairing · flips of {scene.name}")
        self._layers = FlipLayers(client, stage, scene, film, painter, self.show)
        self._cameras = CamerasLayer(client, stage, scene, thumbnails, self._guard(self._enter), lambda node: None)
        self._build()
        self._add_commands()
        self._stand_at(stage.eye)
        release_focus_after_use(client)
        change_in_place(client)
        client.camera.on_update(self._guard.without_event(self._follow_camera))
        self.fill()

    def show(self) -> None:
        """Bring the browser up to date, at once."""
        self.fill()
        self._client.flush()

    def fill(self) -> None:
        """Bring the browser up to date."""
        with self._showing:
            player, film = self._player, self._film
            moment, inside = player.moment, self._look_through.inside
            self._layers.show(
                moment, is_playing=player.is_playing, is_textured=self._is_textured, outside=inside is None
            )
            self._cameras.set_visible(inside is None)
            self._buttons.set(buttons(self._press, moment, len(film), is_playing=player.is_playing))
            self._facts.set(self._camera_line(inside) + facts(film, moment))
            self._plot.set(energy_plot(film, moment, self._press.jump))
            surface = choice(
                {False: ("Flat", self._flat), True: ("Textured", self._textured)}, self._is_textured, "Surface"
            )
            self._legend.set(legend(film, moment) + f"<h4>Surface</h4>{surface}")
            self._strip.set(strip(film, moment, self._press, player.speed))
            self._followed.follow(moment)

    def close(self) -> None:
        """The browser is gone."""
        self._player.stop()
        self._layers.close()
        self._look_through.close()

    def _build(self) -> None:
        gui, player, film = self._client.gui, self._player, self._film
        bridge = Bridge(gui, self._guard)

        def to(where: Callable[[], int]) -> str:
            return bridge.button(lambda: player.go_to(where()))

        self._press = Presses(
            start=to(lambda: 0),
            round_back=to(lambda: film.round_before(player.moment)),
            back=to(lambda: player.moment - 1),
            play=bridge.button(player.play_or_stop),
            forward=to(lambda: player.moment + 1),
            round_on=to(lambda: film.round_after(player.moment)),
            end=to(lambda: len(film)),
            jump=bridge.number(self._jump)("m"),
            speeds=tuple(bridge.button(lambda speed=speed: self._set_speed(speed)) for speed in SPEEDS),
        )
        self._flat = bridge.button(lambda: self._set_textured(False))
        self._textured = bridge.button(lambda: self._set_textured(True))
        self._leave_press = bridge.button(self._leave)
        self._buttons, self._facts, self._plot, self._legend = (HtmlPanel(gui) for _ in range(4))
        timeline = gui.add_panel()
        with timeline.add_tab("Timeline", viser.Icon.CLOCK):
            self._slider = gui.add_slider("Flip", min=0, max=max(1, len(film)), step=1, initial_value=0)
            self._strip = HtmlPanel(gui)
        self._followed = Followed(self._slider, self._guard(self._jump))
        TimelinePlace(gui, timeline, bridge)
        lay_style_sheet(self._client, STYLE + bridge.style)

    def _add_commands(self) -> None:
        player, film, stage = self._player, self._film, self._stage
        commands: list[tuple[str, str, Callable[[], None]]] = [
            ("One flip", ".", lambda: player.go_to(player.moment + 1)),
            ("Back one flip", ",", lambda: player.go_to(player.moment - 1)),
            ("To the end of the round", "]", lambda: player.go_to(film.round_after(player.moment))),
            ("Back to the beginning of the round", "[", lambda: player.go_to(film.round_before(player.moment))),
            ("Play the flips, or stop", "T", player.play_or_stop),
            ("Show the mesh", "M", lambda: self._look_from(stage.eye)),
            ("Show mesh and cameras", "V", lambda: self._look_from(stage.overview())),
            ("Leave the camera", "0", self._leave),
            ("Dark or light", "Y", self._switch_theme),
        ]
        for view_id, view in enumerate(self._scene.views[:9]):
            commands.append((f"Look through camera {view.name}", str(view_id + 1), lambda v=view_id: self._enter(v)))
        for label, key, call in commands:
            hotkey: Any = key
            self._client.gui.add_command(label, hotkey=hotkey).on_trigger(self._guard.without_event(call))

    def _jump(self, moment: object) -> None:
        self._player.go_to(whole_number(moment, 0, max(1, len(self._film)), "flip"))

    def _set_speed(self, speed: int) -> None:
        self._player.speed = speed
        self.show()

    def _set_textured(self, is_textured: bool) -> None:
        self._is_textured = is_textured
        self.show()

    def _switch_theme(self) -> None:
        self._theme.switch()
        self._look_through.renew()

    def _camera_line(self, inside: int | None) -> str:
        if inside is None:
            return ""
        back = button("Leave", self._leave_press, hint="Leave the camera (0)", icon=icon("leave"))
        name = text(self._scene.views[inside].name)
        return f"<div class='row'>{icon('eye')}<span class='grow one'>{name}</span>{back}</div>"

    def _look_from(self, eye: np.ndarray) -> None:
        self._leave()
        self._stand_at(eye)

    def _stand_at(self, eye: np.ndarray) -> None:
        with self._client.atomic():
            self._client.camera.up_direction = self._stage.up
            self._client.camera.position = eye
            self._client.camera.look_at = self._stage.target
            self._client.camera.fov = FIELD_OF_VIEW

    def _enter(self, view_id: object) -> None:
        self._look_through.enter(whole_number(view_id, 0, len(self._scene.views) - 1, "camera"))
        self.show()

    def _leave(self) -> None:
        if self._look_through.inside is not None:
            self._look_through.leave()
            self.show()

    def _follow_camera(self) -> None:
        if self._look_through.follow():
            self._look_through.stay()
            self.show()


class FlipApp:
    """Serves a record of flips to any number of browsers.

    Args:
        scene: the photos with the mesh before any flip.
    """

    def __init__(self, server: viser.ViserServer, scene: Scene, trace: FlipTrace) -> None:
        self._server, self._scene = server, scene
        self.film = FlipFilm(trace)
        self.stage = Stage.of(scene)
        self._thumbnails, self._painter = Thumbnails(scene), BackgroundWorker()
        self.pages: dict[int, FlipPage] = {}
        server.scene.set_up_direction(tuple(self.stage.up))
        camera = server.initial_camera
        camera.position, camera.look_at = tuple(self.stage.eye), tuple(self.stage.target)
        camera.up, camera.fov = tuple(self.stage.up), FIELD_OF_VIEW
        server.on_client_connect(self._welcome)
        server.on_client_disconnect(self._farewell)

    @property
    def url(self) -> str:
        """Where the page is."""
        return address_of(self._server)

    def stop(self) -> None:
        """Let the browsers go."""
        for page in list(self.pages.values()):
            page.close()
        self._painter.close()
        self._thumbnails.close()
        stop_viewer(self._server)

    def _welcome(self, client: viser.ClientHandle) -> None:
        try:
            with client.atomic():
                page = FlipPage(client, self._scene, self.stage, self.film, self._thumbnails, self._painter)
        except Exception:
            logging.getLogger(__name__).exception("a page could not be built")
            client.add_notification("The page could not be built", "See the terminal for the reason.", color="red")
            return
        self.pages[client.client_id] = page
        client.flush()

    def _farewell(self, client: viser.ClientHandle) -> None:
        page = self.pages.pop(client.client_id, None)
        if page is not None:
            page.close()
