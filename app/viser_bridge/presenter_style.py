"""Presenter layout of the page: a style that is on while the body has a class, and the window's width, measured by the page.

viser 1.1.1 sets widths of docked panels in pixels and knows no width of the window; it scales no content either.
"""

import viser

from app.viser_bridge.html_events import HtmlEvents, whole_number
from app.viser_bridge.javascript import run_in_page

LEFT, RIGHT = 0.38, 264 / 1280  # of the window's width
MIDDLE = 1.17  # scale of legend and timeline in the smallest window: the timeline's buttons fit into one row
SMALLEST = 1280  # px: a narrower window is laid out like one of this width
MAX_WIDTH = 20_000  # px

_ON = "body.presenting"
_LEFT, _RIGHT = f"{_ON} [data-dock-region]:not(:has(.pinned))", f"{_ON} [data-dock-region]:has(.pinned)"
_STACK = f"{_LEFT} [data-dock-scroll]"
_TIMELINE = f"{_ON} [data-floating-window]:has([data-dock-tab] + [data-dock-tab]) [data-dock-group]"  # it alone has several tabs

# Left the content is as large as the column; with a lesson, what it shows lies above its text, without what chooses it. Right
# the tabs are hidden. In the middle legend and timeline grow, too.
STYLE = f"""
{_LEFT} .ef, {_LEFT} .mantine-Flex-root:has(> * > * > label) {{ zoom: var(--presenting-left); }}
{_STACK} div:has(> [data-dock-leaf] .lesson) {{ order: 2; }}
{_STACK}:has(.lesson) div:has(> [data-dock-leaf]):not(:has(.lesson)) {{ flex-grow: 0.58 !important; }}
{_STACK} div:has(> div > [data-dock-leaf] .lesson) > div:not(:has(.ef)) {{ display: none !important; }}
{_LEFT}:has(.lesson) .ef :is(.row.pages, .row.faces, .row.chips:has(.tight), .note:not(.stale)) {{ display: none; }}
{_RIGHT} .ef {{ zoom: var(--presenting-right); contain: inline-size; }}
{_RIGHT} div:has(> .ef > .pinned) {{ position: static; }}
{_RIGHT} .mantine-ScrollArea-content div:has(> div > [data-dock-tab]) {{ display: none !important; }}
{_RIGHT} .ef .row {{ flex-wrap: wrap; }} {_RIGHT} .ef .row > .main {{ order: -1; flex: 1 0 100%; }}
{_RIGHT} .ef .row:has(> .main) > button:not(.main) {{ flex: 1; }}
{_RIGHT} .ef .quantities.quantities button.chip.tight {{ padding: 0 1px; font-size: 10px; }}
{_ON} #eigenfairing-overlay, {_TIMELINE} {{ zoom: var(--presenting-middle); }}
{_TIMELINE} .moves {{ display: none; }}
{_RIGHT} .ef .grid {{ grid-template-columns: repeat(5, minmax(0, 1fr)); }} {_RIGHT} .ef .grid span {{ font-size: 10px; }}
{_RIGHT} .ef .grid :is(span.left, span:empty), {_RIGHT} .ef :is(.crumbs .grow, .speed) {{ display: none; }}
"""


class PresenterStyle:
    """The style of one browser, and the widths of its docked panels.

    Args:
        left, right: the docked panels, with their widths outside the presenter layout, px.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        events: HtmlEvents,
        left: tuple[viser.PanelHandle, int],
        right: tuple[viser.MainPanelHandle, int],
    ) -> None:
        self._gui, self._left, self._right = gui, left, right
        self._is_on = False
        self._event = events.add(self._measured)

    def set(self, is_on: bool) -> None:
        """Switch the presenter layout on, or restore the widths from before."""
        self._is_on = is_on
        sizes = {"smallest": SMALLEST, "left": LEFT, "unscaled": self._left[1], "middle": MIDDLE}
        run_in_page(self._gui, "presenter_style", "present", isOn=is_on, event=self._event, **sizes)
        if not is_on:
            for panel, width in (self._left, self._right):
                panel.set_width(width)

    def _measured(self, value: object) -> None:
        width = max(SMALLEST, whole_number(value, 1, MAX_WIDTH, "width of the window"))
        if self._is_on:
            self._left[0].set_width(LEFT * width)
            self._right[0].set_width(RIGHT * width)
