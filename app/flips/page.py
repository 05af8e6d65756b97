"""The page of a flip record in one browser."""

import threading

import viser

from app.background_worker import BackgroundWorker
from app.flips.film import FlipFilm
from app.flips.panels import SPEEDS, buttons, energy_plot, facts, legend, strip
from app.flips.player import Player
from app.flips.scene_layers import FlipLayers
from app.html import button, icon, text
from app.layers.cameras import CamerasLayer, Thumbnails
from app.page.page_frame import Hotkey, PageFrame
from app.panels.choice import choice
from app.stage import Stage
from app.viser_bridge.html_events import choice_of, integer, press, whole_number
from app.viser_bridge.html_panel import HtmlPanel
from app.viser_bridge.synced_widget import SyncedSlider
from fairing.scene import Scene

SURFACES = {False: "Flat", True: "Textured"}


class FlipPage:
    """Every browser has a moment of its own."""

    def __init__(
        self, client: viser.ClientHandle, scene: Scene, stage: Stage, film: FlipFilm, thumbnails: Thumbnails,
        painter: BackgroundWorker,
    ) -> None:  # fmt: skip
        self._client, self._scene, self._film = client, scene, film
        self._player = Player(len(film), SPEEDS[1], self.show)
        self._is_textured = True
        self._showing = threading.RLock()  # the player and a click may show moments at the same time
        self._is_built = False
        self.frame = PageFrame(client, f"flips of {scene.name}", stage, scene, lambda _: self.show(), self.show)
        self._layers = FlipLayers(client, stage, scene, film, painter, self.show)
        self._cameras = CamerasLayer(client, stage, scene, thumbnails, self.frame.toasts(self.frame.camera.enter))
        self._build()
        self.frame.add_hotkeys([*self._hotkeys(), *self.frame.camera_hotkeys()])
        self._is_built = True
        self.fill()

    def show(self) -> None:
        """Bring the browser up to date, at once."""
        if self._is_built:
            self.fill()
            self._client.flush()

    def fill(self) -> None:
        """Queue the messages that bring the browser up to date."""
        with self._showing:
            player, film, events = self._player, self._film, self._events
            moment, entered = player.moment, self.frame.camera.entered
            self._layers.show(
                moment, is_playing=player.is_playing, is_textured=self._is_textured, outside=entered is None
            )
            self._cameras.set_visible(entered is None)
            self._buttons.set(buttons(events, moment, len(film), is_playing=player.is_playing))
            self._facts.set(self._camera_line(entered) + facts(film, moment))
            self._plot.set(energy_plot(film, moment, events("jump", "m")))
            surfaces = {value: (label, events("surface", k)) for k, (value, label) in enumerate(SURFACES.items())}
            surface = choice(surfaces, self._is_textured, "Surface")
            self._legend.set(legend(film, moment) + f"<h4>Surface</h4>{surface}")
            self._strip.set(strip(film, moment, events, player.speed))
            self._slider.follow(moment)

    def close(self) -> None:
        """The browser has disconnected."""
        self._player.stop()
        self._layers.close()
        self.frame.close()

    def _build(self) -> None:
        gui, player, film, html_events = self._client.gui, self._player, self._film, self.frame.html_events
        self._events = html_events.named(
            {
                "start": press(lambda: player.go_to(0)),
                "round_back": press(lambda: player.go_to(film.round_before(player.moment))),
                "back": press(lambda: player.go_to(player.moment - 1)),
                "play": press(player.play_or_stop),
                "forward": press(lambda: player.go_to(player.moment + 1)),
                "round_on": press(lambda: player.go_to(film.round_after(player.moment))),
                "end": press(lambda: player.go_to(len(film))),
                "jump": integer(player.go_to, "flip", 0, max(1, len(film))),
                "speed": choice_of(self._set_speed, lambda: SPEEDS, "speed"),
                "surface": choice_of(self._set_textured, lambda: list(SURFACES), "surface"),
                "leave": press(self.frame.camera.leave),
            }
        )
        self._buttons, self._facts, self._plot, self._legend = (HtmlPanel(gui) for _ in range(4))
        timeline = gui.add_panel()
        with timeline.add_tab("Timeline", viser.Icon.CLOCK):
            slider = gui.add_slider("Flip", min=0, max=max(1, len(film)), step=1, initial_value=0)
            self._strip = HtmlPanel(gui)
        self._slider = SyncedSlider(slider, html_events.guarded(self._jump))
        self.frame.finish(timeline)

    def _hotkeys(self) -> list[Hotkey]:
        player, film = self._player, self._film
        return [
            Hotkey("One flip", lambda: player.go_to(player.moment + 1), "."),
            Hotkey("Back one flip", lambda: player.go_to(player.moment - 1), ","),
            Hotkey("To the end of the round", lambda: player.go_to(film.round_after(player.moment)), "]"),
            Hotkey("Back to the beginning of the round", lambda: player.go_to(film.round_before(player.moment)), "["),
            Hotkey("Play the flips, or stop", player.play_or_stop, "T"),
        ]

    def _jump(self, moment: object) -> None:
        self._player.go_to(whole_number(moment, 0, max(1, len(self._film)), "flip"))

    def _set_speed(self, speed: int) -> None:
        self._player.speed = speed
        self.show()

    def _set_textured(self, is_textured: bool) -> None:
        self._is_textured = is_textured
        self.show()

    def _camera_line(self, entered: int | None) -> str:
        if entered is None:
            return ""
        back = button("Leave", self._events("leave"), hint="Leave the camera (0)", icon=icon("leave"))
        name = text(self._scene.views[entered].name)
        return f"<div class='row'>{icon('eye')}<span class='grow one'>{name}</span>{back}</div>"
