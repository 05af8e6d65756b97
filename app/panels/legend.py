"""Legend of the surface colours, in a corner of the 3D view."""

import viser

from app.html import number, text
from app.palette import RGB, solid
from app.pictures.coloring import UNKNOWN, Legend, Scale, color_map
from app.viser_bridge.floating import MARGIN
from app.viser_bridge.html_panel import HtmlPanel

WIDTH = 236
STOPS = 16


class LegendBox:
    """Shown while the surface is coloured by a quantity."""

    def __init__(self, gui: viser.GuiApi) -> None:
        self._box = gui.add_panel(visible=False)
        with self._box.add_tab("Colours", viser.Icon.PALETTE):
            self._panel = HtmlPanel(gui)
        self._box.float(x=MARGIN, y=MARGIN, width=WIDTH)

    def show(self, legend: Legend | None) -> None:
        if legend is not None:
            self._panel.set(legend_html(legend))
        self._box.visible = legend is not None


def legend_html(legend: Legend) -> str:
    """Markup: title and colour scale with its ends and extremes; for categories their names and counts."""
    coloring = legend.coloring
    whose = "faces" if coloring.by_face else "vertices"
    parts = [f"<div class='legend'><b>{text(coloring.title)}</b>"]
    if coloring.scale is Scale.REASON:
        parts += [_entry(color, name, str(count)) for name, color, count in legend.categories]
    elif legend.high > legend.low:
        parts.append(_bar(legend))
    elif legend.unknown == 0 or legend.largest:
        parts.append(_entry(_color(0), f"all {whose}", _value(legend.low, legend)))
    if legend.unknown:
        parts.append(_entry(UNKNOWN, "unknown", str(legend.unknown)))
    if legend.moment is not None:
        parts.append(f"<div class='selected'>of moment {legend.moment}; the present one is being computed</div>")
    return "".join(parts) + "</div>"


def _bar(legend: Legend) -> str:
    stops = ",".join(solid(_color(k / (STOPS - 1))) for k in range(STOPS))
    middle = (legend.low * legend.high) ** 0.5 if _is_log(legend) else (legend.low + legend.high) / 2
    low, high = _value(legend.low, legend), _value(legend.high, legend)
    if legend.smallest < legend.low:
        low = f"≤ {low}"
    if legend.largest > legend.high:
        high = f"≥ {high}"
    ends = f"<div class='ends'><span>{low}</span><span>{_value(middle, legend)}</span><span>{high}</span></div>"
    extremes = f"from {_value(legend.smallest, legend)} to {_value(legend.largest, legend)}"
    note = f"{extremes}{', logarithmic' if _is_log(legend) else ''}"
    return f"<div class='scale' style='background:linear-gradient(90deg,{stops})'></div>{ends}<div class='dim'>{note}</div>"


def _is_log(legend: Legend) -> bool:
    return legend.coloring.scale is Scale.LOGARITHMIC


def _value(value: float, legend: Legend) -> str:
    if legend.coloring.scale is Scale.COUNT:
        return f"{value:g}"
    unit = f" {legend.coloring.unit}" if legend.coloring.unit else ""
    return f"{number(value, 3)}{text(unit)}"


def _entry(color: RGB, name: str, value: str) -> str:
    swatch = f"<span class='swatch' style='background:{solid(color)}'></span>"
    return f"<div class='row'>{swatch}<span class='grow'>{text(name)}</span><span>{value}</span></div>"


def _color(at: float) -> RGB:
    colors = color_map()
    red, green, blue = (int(x) for x in colors[round(at * (len(colors) - 1))])
    return red, green, blue
