"""Expressions somebody watches: their value now, and how they went."""

from collections.abc import Callable

import viser

from app.debugger.condition import Condition
from app.debugger.run_state import RunState
from app.debugger.series import Series, thinned
from app.debugger.watch import understand_watch, watch_series, with_watch
from app.html import button, icon, number, text
from app.page_state.page_state import PageState
from app.palette import NOW, SELECTED, css
from app.viser_bridge.html_events import Bridge, whole_number
from app.viser_bridge.html_panel import HtmlPanel
from app.viser_bridge.text_field import Line
from fairing.errors import InputError
from fairing.scene import Scene

SPARK = (96, 20)  # px


class WatchControls:
    """JavaScript for the panel's buttons; made where they stay on the page when the panel is not."""

    def __init__(
        self, bridge: Bridge, view: PageState, jump: Callable[[object], None], republish: Callable[[], None]
    ) -> None:
        def remove(n: object) -> None:
            at = whole_number(n, 0, max(0, len(view.watches) - 1), "watch")
            view.watches = view.watches[:at] + view.watches[at + 1 :]
            republish()

        self.remove = bridge.number(remove)
        self.jump = bridge.number(jump)


class WatchPanel:
    """Every browser has expressions of its own."""

    def __init__(
        self,
        gui: viser.GuiApi,
        scene: Scene,
        page_state: PageState,
        controls: WatchControls,
        bridge: Bridge,
        republish: Callable[[], None],
    ) -> None:
        self._controls = controls
        self._series: dict[str, Series] = {}

        def add(expression: str) -> None:
            try:
                page_state.watches = with_watch(page_state.watches, understand_watch(expression, scene))
            except InputError:
                line.write(expression)
                raise
            republish()

        line = Line(gui, bridge, "Watch", "Such as energy / 1000, moved(0) or 100 * weakest. Enter adds it.", add)
        self._panel = HtmlPanel(gui)

    def show(self, state: RunState, page_state: PageState) -> None:
        self._series = {watch.text: self._series.get(watch.text) or watch_series(watch) for watch in page_state.watches}
        self._panel.set("".join(self._row(n, watch, state) for n, watch in enumerate(page_state.watches)))

    def _row(self, n: int, watch: Condition, state: RunState) -> str:
        series = self._series[watch.text]
        series.update(state)
        value = series.at(state.moment)
        remove = button("", self._controls.remove(str(n)), hint=f"Stop watching {watch.text}", icon=icon("leave"),
                        css_class="small")  # fmt: skip
        return (
            f"<div class='row breakpoint'><code class='grow'>{text(watch.text)}</code>"
            f"{self._spark(series, state)}<b class='value'>{number(value) if value == value else '–'}</b>{remove}</div>"
        )

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
        press = "var r=this.getBoundingClientRect();" + self._controls.jump(
            f"Math.max(0,Math.round((event.clientX-r.left)/r.width*{state.length}))"
        )
        return (
            f'<svg viewBox="0 0 {width} {height}" style="width:{width}px;height:{height}px;cursor:pointer" '
            f'onpointerdown="{text(press)}"><title>{text(number(low))} to {text(number(high))}; click to go there</title>'
            f'<rect width="{width}" height="{height}" fill="transparent"/>'
            f'<polyline points="{points}" fill="none" stroke="{css(NOW)}" stroke-width="1.4"/>'
            f'<line x1="{at:.1f}" x2="{at:.1f}" y1="0" y2="{height}" stroke="{css(SELECTED)}"/></svg>'
        )
