"""The page of a flip record in one browser."""

import threading

import viser

from app.background_worker import BackgroundWorker
from app.debugger.actions import CAMERA_KEYS, KEY_LABELS
from app.flips.carving_panels import chapter_band
from app.flips.carving_view import CarvingView
from app.flips.panels import SPEEDS, STEP_RATES, buttons, energy_plot, facts, legend, strip
from app.flips.player import Player
from app.flips.scene_layers import FlipLayers
from app.flips.split_layers import SplitLayers
from app.flips.split_panels import split_facts, split_legend
from app.flips.story import Story
from app.html import button, icon, text
from app.keys import key_text
from app.layers.cameras import CamerasLayer, Thumbnails
from app.page.page_frame import Hotkey, PageFrame
from app.panels.choice import choice
from app.panels.keys_dialog import KeysDialog
from app.stage import Stage
from app.viser_bridge.html_events import choice_of, integer, press, whole_number
from app.viser_bridge.html_panel import HtmlPanel
from app.viser_bridge.node_events import BackgroundClicks
from app.viser_bridge.synced_widget import SyncedSlider
from fairing.scene import Scene

SURFACES = {False: "Flat", True: "Textured"}


class FlipPage:
    """Every browser has a moment of its own."""

    def __init__(
        self, client: viser.ClientHandle, scene: Scene, stage: Stage, story: Story, thumbnails: Thumbnails,
        painter: BackgroundWorker,
    ) -> None:  # fmt: skip
        self._client, self._scene, self._story, self._film = client, scene, story, story.film
        self._player = Player(len(story), SPEEDS[1], self.show, self._rate)
        self._is_textured = True
        self._showing = threading.RLock()  # the player and a click may show moments at the same time
        self._is_built = False
        self.frame = PageFrame(client, _title(scene, story), stage, scene, lambda _: self.show(), self.show)
        self._layers = FlipLayers(client, stage, scene, story.film, painter, self.show)
        self._carving = (
            None
            if story.carving is None
            else CarvingView(client, stage, story, story.carving, self.show, self.frame.camera.look_along)
        )
        self._splits = SplitLayers(client, stage)
        background = BackgroundClicks(client, self.frame.toasts(self._click_background))
        enter = self.frame.toasts(self.frame.camera.enter)
        self._cameras = CamerasLayer(client, stage, scene, thumbnails, enter, background)
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
            player, story, events = self._player, self._story, self._events
            moment, entered = player.moment, self.frame.camera.entered
            flip, split, outside = story.flip(moment), story.split(moment), entered is None
            self._layers.show(flip, is_playing=player.is_playing, is_textured=self._is_textured, outside=outside)
            split_mesh = None if split is None else story.splits.mesh(split)
            self._splits.show(split_mesh, outside=outside)
            if self._carving is not None:
                self._carving.fill(moment, outside=outside)
                self._terms.set(self._carving.terms(moment, events))
                self._section.visible = self._carving.is_sectioned(moment) and self._carving.section.direction != "off"
            self._cameras.set_visible(outside)
            self._buttons.set(buttons(events, moment, len(story), story.step_names, is_playing=player.is_playing))
            if flip is not None:
                self._fill_flip(flip, entered)
            elif split is not None and split_mesh is not None:
                self._fill(entered, split_facts(story.splits, split), split_legend(split_mesh))
            elif self._carving is not None:
                self._fill(entered, self._carving.facts(moment), self._carving.legend(moment, events))
            band = chapter_band(story, moment, events) if story.has_chapters else ""
            begin = story.extents[-1].begin
            self._strip.set(
                strip(self._film, flip, events, player.speed, begin, has_chapters=story.has_chapters) + band
            )
            self._slider.follow(moment)

    def close(self) -> None:
        """The browser has disconnected."""
        self._player.stop()
        self._layers.close()
        self.frame.close()

    def _build(self) -> None:
        gui, player, story, html_events = self._client.gui, self._player, self._story, self.frame.html_events
        self._events = html_events.named(
            {
                "start": press(lambda: player.go_to(0)),
                "round_back": press(lambda: player.go_to(story.part_before(player.moment))),
                "back": press(lambda: player.go_to(player.moment - 1)),
                "play": press(player.play_or_stop),
                "forward": press(lambda: player.go_to(player.moment + 1)),
                "round_on": press(lambda: player.go_to(story.part_after(player.moment))),
                "end": press(lambda: player.go_to(len(story))),
                "jump": integer(player.go_to, "step", 0, max(1, len(story))),
                "speed": choice_of(self._set_speed, lambda: SPEEDS, "speed"),
                "surface": choice_of(self._set_textured, lambda: list(SURFACES), "surface"),
                "leave": press(self.frame.camera.leave),
                **({} if self._carving is None else self._carving.handlers()),
            }
        )
        self._buttons, self._facts, self._plot, self._legend = (HtmlPanel(gui) for _ in range(4))
        self._keys = KeysDialog(gui, html_events)
        if self._carving is not None:
            self._section = gui.add_slider("Depth, %", min=-100, max=100, step=1, initial_value=0, visible=False)
            self._terms = HtmlPanel(gui)
            SyncedSlider(self._section, html_events.guarded(self._carving.move_section))
        timeline = gui.add_panel()
        with timeline.add_tab("Timeline", viser.Icon.CLOCK):
            slider = gui.add_slider(
                story.step_names[0].capitalize(), min=0, max=max(1, len(story)), step=1, initial_value=0
            )
            self._strip = HtmlPanel(gui)
        self._slider = SyncedSlider(slider, html_events.guarded(self._jump))
        self.frame.finish(timeline)

    def _fill(self, entered: int | None, facts: str, legend: str) -> None:
        """The panels at a moment before the flips."""
        self._facts.set(self._camera_line(entered) + facts)
        self._plot.set("")
        self._legend.set(legend)

    def _fill_flip(self, flip: int, entered: int | None) -> None:
        """The panels at a moment of the flips."""
        film, events, begin = self._film, self._events, self._story.extents[-1].begin
        self._facts.set(self._camera_line(entered) + facts(film, flip))
        self._plot.set(energy_plot(film, flip, events, begin))
        surfaces = {value: (label, events("surface", k)) for k, (value, label) in enumerate(SURFACES.items())}
        surface = choice(surfaces, self._is_textured, "Surface")
        self._legend.set(legend(film, flip) + f"<h4>Surface</h4>{surface}")

    def _hotkeys(self) -> list[Hotkey]:
        player, story = self._player, self._story
        one, part = story.step_names
        hotkeys = [
            Hotkey(f"One {one}", lambda: player.go_to(player.moment + 1), ".", None, (("F11", None),)),
            Hotkey(f"Back one {one}", lambda: player.go_to(player.moment - 1), ",", None, (("F11", "shift"),)),
            Hotkey(f"To the end of the {part}", lambda: player.go_to(story.part_after(player.moment)), "]"),
            Hotkey(f"Back to the beginning of the {part}", lambda: player.go_to(story.part_before(player.moment)), "["),
            Hotkey(f"Play the {one}s, or stop", player.play_or_stop, "T"),
        ]
        return [*hotkeys, Hotkey(KEY_LABELS["?"], lambda: self._keys.open(self._key_rows(hotkeys)), "?", "shift")]

    def _key_rows(self, hotkeys: list[Hotkey]) -> list[tuple[str, str]]:
        """The rows of the keys dialog."""
        own = [
            (", ".join(key_text(*key) for key in ((k.key or "", k.modifier), *k.other_keys)), k.label) for k in hotkeys
        ]
        further = ("M", "V", "Shift+F", "Shift+T", "Y", "Ctrl+K", "?")
        return [*own, *CAMERA_KEYS, *((key, KEY_LABELS[key]) for key in further)]

    def _rate(self, speed: int, moment: int) -> float:
        """Moments a second: other steps are played slower than flips, since each has a sentence to be read."""
        return speed if self._story.flip(moment) is not None else STEP_RATES[SPEEDS.index(speed)]

    def _click_background(self, event: viser.SceneClickEvent) -> None:
        if self._carving is not None and self._story.is_carving(self._player.moment):
            self._carving.click(event)

    def _jump(self, moment: object) -> None:
        self._player.go_to(whole_number(moment, 0, max(1, len(self._story)), "step"))

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


def _title(scene: Scene, story: Story) -> str:
    if story.carving is not None:
        return f"start mesh of {scene.name}"
    return f"splits of {scene.name}" if story.has_chapters else f"flips of {scene.name}"
