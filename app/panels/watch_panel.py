"""Watch panel: expressions with their current value and a sparkline of their history."""

from collections.abc import Callable, Iterable

import viser

from app.debugger.condition import Condition
from app.debugger.run_state import RunState
from app.debugger.series import Series, thinned
from app.debugger.watch import COMPUTED, needs_pulls, parse_watch, value_with_pulls, watch_series, with_watch
from app.html import button, icon, number, text
from app.page_state.page_state import PageState
from app.page_state.pull_source import PullSource
from app.palette import NOW, SELECTED, css
from app.panels.condition_field import ConditionField
from app.viser_bridge.html_events import Handler, HtmlEvents, choice_of
from app.viser_bridge.html_panel import HtmlPanel
from fairing.run.recorded_terms import term_meanings
from fairing.scene import Scene

SPARK = (96, 20)  # px


class WatchPanel:
    """The watch expressions of one browser."""

    def __init__(
        self,
        gui: viser.GuiApi,
        html_events: HtmlEvents,
        scene: Scene,
        page_state: PageState,
        pulls: PullSource,
        jump: Handler,
        republish: Callable[[], None],
    ) -> None:
        self._pulls = pulls
        self._series: dict[str, Series] = {}

        def add(expression: str, terms: Iterable[str]) -> None:
            page_state.watches = with_watch(page_state.watches, parse_watch(expression, scene, terms))
            republish()

        hint = "An expression such as energy / 1000, moved(0) or 100 * weakest. Enter adds it."
        self._field = ConditionField(gui, html_events, "Watch", hint, add, without=COMPUTED)
        self._panel = HtmlPanel(gui)

        def remove(watch: Condition) -> None:
            page_state.watches = tuple(other for other in page_state.watches if other is not watch)
            republish()

        self._events = html_events.named(
            {"remove": choice_of(remove, lambda: page_state.watches, "watch"), "jump": jump}
        )

    def show(self, state: RunState, page_state: PageState) -> None:
        self._field.show(page_state, term_meanings(state.trace))
        self._series = {watch.text: self._series.get(watch.text) or watch_series(watch) for watch in page_state.watches}
        self._panel.set("".join(self._row(n, watch, state) for n, watch in enumerate(page_state.watches)))

    def _row(self, n: int, watch: Condition, state: RunState) -> str:
        if needs_pulls(watch):
            spark, shown = "", self._with_pulls(watch, state)
        else:
            series = self._series[watch.text]
            series.update(state)
            value = series.at(state.moment)
            spark, shown = self._spark(series, state), number(value) if value == value else "–"
        remove = button("", self._events("remove", n), hint=f"Stop watching {watch.text}", icon=icon("leave"),
                        css_class="small")  # fmt: skip
        return (
            f"<div class='row breakpoint'><code class='grow'>{text(watch.text)}</code>"
            f"{spark}<b class='value'>{shown}</b>{remove}</div>"
        )

    def _with_pulls(self, watch: Condition, state: RunState) -> str:
        """The value of an expression on pulls, which are computed for the moment shown, while the engine is paused."""
        found = self._pulls.at(state)
        if state.record is None or isinstance(found, Exception):
            return "–"
        if found is None:
            return "…"
        value = value_with_pulls(watch, state.record, state.moment, found)
        return number(value) if value == value else "–"

    def _spark(self, series: Series, state: RunState) -> str:
        moments, values = series.moments, series.values
        if len(moments) == 0:
            return ""
        width, height = SPARK
        chosen = thinned(moments, values, width)
        moments, values = moments[chosen], values[chosen]
        low, high = float(values.min()), float(values.max())
        x = width * moments / max(1, state.length)
        y = height - 2 - (height - 4) * (values - low) / ((high - low) or 1.0)
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
        at = width * state.moment / max(1, state.length)
        press = self._events("jump", f"ef.moment(event,{state.length},{state.length})")
        return (
            f'<svg viewBox="0 0 {width} {height}" style="width:{width}px;height:{height}px;cursor:pointer" '
            f'onpointerdown="{text(press)}"><title>{text(number(low))} to {text(number(high))}; click to go to a moment</title>'
            f'<rect width="{width}" height="{height}" fill="transparent"/>'
            f'<polyline points="{points}" fill="none" stroke="{css(NOW)}" stroke-width="1.4"/>'
            f'<line x1="{at:.1f}" x2="{at:.1f}" y1="0" y2="{height}" stroke="{css(SELECTED)}"/></svg>'
        )
