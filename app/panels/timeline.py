"""Timeline: a slider over the recorded moments, a strip with one colour per moment, and playback controls."""

import threading
import time

import numpy as np
import viser

from app.debugger.commands import Pause, Play
from app.debugger.controller import Controller
from app.debugger.history import EnergyHistory
from app.debugger.run_state import Activity, RunState
from app.html import button, icon, text
from app.page_state.page_state import PageState
from app.page_state.run_controls import RunControls
from app.panels.stage_band import stage_band
from app.pictures.cell_images import data_uri
from app.pictures.strip import KINDS, StepHistory
from app.plot_line import begins
from app.viser_bridge.html_events import HtmlEvents, choice_of, press
from app.viser_bridge.html_panel import HtmlPanel
from app.viser_bridge.slider_marks import set_slider_marks
from app.viser_bridge.synced_widget import on_user_change

SETTLE = 0.5  # s after a move by the user, in which states already on their way do not move the slider back
SPEEDS = (0.5, 1.0, 5.0, 20.0, 50.0)
MOMENTS_PER_SECOND = 4.0  # at speed 1
MAX_TICKS = 80
MARKS_APART = 0.07  # of the slider's length: at smaller distances the labels would overlap


class Timeline:
    """Moves the run to any recorded moment. Strip and slider have ticks where sweeps and levels begin."""

    def __init__(
        self,
        gui: viser.GuiApi,
        html_events: HtmlEvents,
        controller: Controller,
        page_state: PageState,
        energies: EnergyHistory,
        run_controls: RunControls,
    ) -> None:
        self._controller, self._page_state, self._energies = controller, page_state, energies
        self._events = html_events.named(
            {
                "play": press(self.play_or_stop),
                "follow": press(self._follow),
                "speed": choice_of(self._set_speed, lambda: SPEEDS, "speed"),
                "strip": choice_of(self._set_strip, lambda: list(KINDS), "strip"),
                "jump": run_controls.jump,
                "previous_move": press(lambda: run_controls.to_move_of_selected(-1)),
                "next_move": press(lambda: run_controls.to_move_of_selected(1)),
            }
        )
        self._slider = gui.add_slider("Moment", min=0, max=1, step=1, initial_value=0)
        self._panel = HtmlPanel(gui)
        self._moved = 0.0
        self._timer: threading.Timer | None = None
        self._marks: list[tuple[float, str | None]] = []
        self._history = StepHistory()
        jump = html_events.guarded(run_controls.jump)

        def moved(value: float) -> None:
            self._moved = time.monotonic()
            jump(value)

        on_user_change(self._slider, moved)

    def play_or_stop(self) -> None:
        """Play from here, or stop playing."""
        playing = self._controller.state.activity is Activity.PLAYING
        self._controller.post(Pause() if playing else self._play())

    def _play(self) -> Play:
        return Play(self._page_state.speed * MOMENTS_PER_SECOND)

    def _follow(self) -> None:
        self._page_state.viewed_moment = None
        self._controller.republish()

    def _set_speed(self, speed: float) -> None:
        self._page_state.speed = speed
        if self._controller.state.activity is Activity.PLAYING:
            self._controller.post(self._play())
        self._controller.republish()

    def _set_strip(self, kind: str) -> None:
        self._page_state.strip = kind
        self._controller.republish()

    def show(self, state: RunState, page_state: PageState) -> None:
        last = max(1, state.length)
        if self._slider.max != last:
            self._slider.max = last
        self._slider.disabled = state.length == 0
        self._place_slider(state.moment)
        marks = _level_marks(self._energies.levels[: state.length])
        if marks != self._marks:
            self._marks = marks
            set_slider_marks(self._slider, marks)
        self._history.update(state)
        self._panel.set(
            f"<div class='row tools'>{self._buttons(state, page_state)}</div>{self._picture(state, page_state)}"
        )

    def _place_slider(self, moment: int) -> None:
        """Move the slider to a moment, once a move by the user has settled."""
        if self._slider.value == moment:
            return
        left = self._moved + SETTLE - time.monotonic()
        if left <= 0:
            self._slider.value = moment
        elif self._timer is None or not self._timer.is_alive():
            self._timer = threading.Timer(left, self._controller.republish)
            self._timer.daemon = True
            self._timer.start()

    def _buttons(self, state: RunState, page_state: PageState) -> str:
        if page_state.viewed_moment is not None:
            player = button(
                "Follow live",
                self._events("follow"),
                hint="Follow live (return to the current moment of the run)",
                icon=icon("end"),
                css_class="small on",
            )
        elif state.activity is Activity.PLAYING:
            player = button("", self._events("play"), hint="Stop playing (T)", icon=icon("pause"), css_class="small on")
        else:
            enabled = state.length > 0 and state.activity is Activity.PAUSED
            player = button(
                "",
                self._events("play"),
                hint="Play the recorded steps (T)",
                icon=icon("run"),
                css_class="small",
                enabled=enabled,
            )
        speeds = "".join(
            button(
                f"×{'½' if speed == 0.5 else f'{speed:g}'}",
                self._events("speed", k),
                hint=f"Play {speed * MOMENTS_PER_SECOND:g} moments a second",
                css_class="small on" if speed == page_state.speed else "small",
                pressed=speed == page_state.speed,
            )
            for k, speed in enumerate(SPEEDS)
        )
        kinds = "".join(
            button(
                kind,
                self._events("strip", k),
                hint=hint,
                css_class="small on" if kind == page_state.strip else "small",
                pressed=kind == page_state.strip,
            )
            for k, (kind, hint) in enumerate(KINDS.items())
        )
        moves = self._moves(state, page_state)
        return (
            f"{player}{speeds}<span class='grow'></span><span class='row moves'>{moves}</span>"
            f"<span class='grow'></span><span class='row'>{kinds}</span>"
        )

    def _moves(self, state: RunState, page_state: PageState) -> str:
        enabled = page_state.selected is not None and state.length > 0
        moves = (
            "<span class='dim'>Moves</span>"
            if page_state.selected is None
            else f"<span class='dim' style='white-space:nowrap' title='Moves of this vertex'>v {page_state.selected}</span>"
        )
        before, after = (
            button(
                "",
                self._events(event),
                hint=hint,
                icon=icon("one", mirrored=mirrored),
                css_class="small",
                enabled=enabled,
            )
            for event, hint, mirrored in (
                ("previous_move", "Previous move of the selected vertex (;)", True),
                ("next_move", "Next move of the selected vertex (')", False),
            )
        )
        return f"{moves}{before}{after}"

    def _picture(self, state: RunState, page_state: PageState) -> str:
        if state.length == 0:
            return (
                "<div class='row extent'><span>Steps</span><div class='strip'></div></div>"
                "<div class='row extent'><span>Stages</span><div class='stages'></div></div>"
            )
        cursor = 100 * state.moment / state.length
        press = self._events("jump", f"ef.step(event,{state.length})")
        stages = self._energies.stages(state.length)
        band = stage_band(stages, state.options, state.length, state.moment, lambda m: self._events("jump", str(m)))
        return (
            "<div class='row extent'><span>Steps</span>"
            f"<div class='strip' role='img' aria-label='Recorded moments' onpointerdown=\"{text(press)}\" "
            f"title='{text(KINDS[page_state.strip])} Click to go to a moment.'>"
            f"<img src='{data_uri(self._history.picture(page_state.strip))}' alt=''>{self._ticks(state)}"
            f"<i style='left:{cursor:.2f}%'></i></div></div>"
            f"<div class='row extent'><span>Stages</span>{band}</div>"
        )

    def _ticks(self, state: RunState) -> str:
        """Long ticks at the beginning of levels; short ticks at sweeps, unless there are more than `MAX_TICKS`."""
        levels = begins(self._energies.levels[: state.length])
        sweeps = np.setdiff1d(begins(self._energies.sweeps[: state.length]), levels)
        ticks = [(moment, "level") for moment in levels]
        if len(sweeps) <= MAX_TICKS:
            ticks += [(moment, "sweep") for moment in sweeps]
        return "".join(
            f"<s class='{name}' style='left:{100 * moment / state.length:.2f}%'></s>"
            for moment, name in ticks
            if moment
        )


def _level_marks(levels: np.ndarray) -> list[tuple[float, str | None]]:
    """A mark at the beginning of each level, with its name if there is room."""
    marks: list[tuple[float, str | None]] = []
    named = -1.0
    for moment in begins(levels):
        has_room = moment >= named + MARKS_APART * len(levels)
        named = float(moment) if has_room or not marks else named
        marks.append((float(moment), f"L{levels[moment] + 1}" if named == moment else None))
    return marks
