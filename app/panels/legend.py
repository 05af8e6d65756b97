"""Legend of the lines, the vertex marks and the surface colours, in a corner of the 3D view."""

from typing import Any

import numpy as np
import viser

from app.debugger.moment_pulls import MomentPulls
from app.debugger.run_state import RunState
from app.html import number, text
from app.page_state.association_source import AssociationSource
from app.page_state.page_state import ASSOCIATIONS, PageState
from app.page_state.pull_source import PullSource, arrow_scale, chosen_vertices
from app.page_state.vertex_marks import MARK_COLORS, shown_vertices, stepped_vertex, vertex_colors
from app.palette import AXIS_COLORS, LOCKED, NOW, REFERENCE, RGB, SEEN, SELECTED, START, STEPPED, TRUTH, solid
from app.pictures.coloring import COLORINGS, HUES, PER_PIXEL, UNKNOWN, ZERO, Legend, Scale, color_map
from app.pictures.term_colors import COLOR_OF_TERM, colors_of_terms
from app.viser_bridge.view_overlay import ViewOverlay
from fairing.mesh import Mesh
from fairing.terms.names import IMAGE_EDGES, POINTS

STOPS = 16
PATH = f"linear-gradient(90deg,{solid(START)},{solid(NOW)})"


class LegendBox:
    """Overlay in the corner of the 3D view, as small as its content, so that it covers little of the mesh."""

    def __init__(
        self, client: viser.ClientHandle, mesh: Mesh, pulls: PullSource, associations: AssociationSource
    ) -> None:
        self._mesh, self._pulls, self._associations = mesh, pulls, associations
        self._overlay = ViewOverlay(client)

    def show(self, state: RunState, page_state: PageState, legend: Legend | None, is_painting: bool) -> None:
        """Args:
        legend: of the surface colours; None if the surface is not coloured.
        is_painting: whether the surface waits for its texture.
        """
        content = lines_html(legend_lines(state, page_state)) + marks_html(state, page_state)
        pulls = self._pulls.drawn(state, page_state)
        if pulls is not None:
            content += pull_arrows_html(pulls, page_state, arrow_scale(pulls, page_state, self._mesh, state.vertices))
        found = {layer: self._associations.shown(layer, state, page_state) for layer in ASSOCIATIONS}
        content += lines_html(association_lines(found, page_state.entered))
        if is_painting:
            content += "<div class='dim'>Painting the texture…</div>"
        if legend is not None:
            content += legend_html(legend)
        elif page_state.surface in COLORINGS and page_state.entered is None and not state.is_moving:
            awaited = (PER_PIXEL if page_state.shows_texels else COLORINGS)[page_state.surface]
            content += f"<div class='legend'><b>{text(awaited.title)}</b><div class='dim'>Computing…</div></div>"
        self._overlay.set(content)


def legend_lines(state: RunState, page_state: PageState) -> list[tuple[str, RGB]]:
    """Names and colours of the lines in the 3D view."""
    has_moved = bool((state.vertices != state.trace.start).any())
    lines = {
        "Start": (START, page_state.shows("start") and has_moved),
        "Now": (NOW, page_state.shows("now")),
        "Truth": (TRUTH, page_state.shows("truth")),
        "A": (REFERENCE, page_state.reference is not None),
    }
    return [(name, color) for name, (color, is_shown) in lines.items() if is_shown]


def association_lines(found: dict[str, Any], entered: int | None) -> list[tuple[str, RGB]]:
    """Names and colours of the lines of the associations that are shown, by layer; None for a layer that is not."""
    lines: list[tuple[str, RGB]] = []
    rejects = False
    for layer, name, term in (("point feet", "points that pull", POINTS), ("image edges", "image edges", IMAGE_EDGES)):
        if found[layer] is not None:
            held = ~found[layer].rejected
            lines.append((f"{int(held.sum())} {name}", COLOR_OF_TERM[term]))
            rejects |= not held.all()
    if rejects:
        lines.append(("rejected by the loss", LOCKED))
    if found["axes"] is not None:
        counts = np.bincount(found["axes"].axis, minlength=len(AXIS_COLORS))
        is_building = len(found["axes"].axes) > 0
        lines += [
            (f"{counts[k]} edges along axis {k + 1}" if is_building else "no axes: not a building", color)
            for k, color in enumerate(AXIS_COLORS[: 3 if is_building else 1])
        ]
    if found["seen"] is not None and entered is not None:
        lines.append((f"{int(found['seen'][:, entered].sum())} faces seen by this photo", SEEN))
    return lines


def lines_html(lines: list[tuple[str, RGB]]) -> str:
    """Markup: every line with a dash in its colour."""
    dashes = "".join(f"<span><i style='background:{solid(color)}'></i>{text(name)}</span>" for name, color in lines)
    return f"<div class='lines'>{dashes}</div>" if lines else ""


def marks_html(state: RunState, page_state: PageState) -> str:
    """Markup: every colour that the shown vertex marks have now, and the ring around the vertex of the last step."""
    colors = vertex_colors(state, page_state.selection.vertices)[shown_vertices(state, page_state)]
    marks = [
        f"<span><i class='{'block' if color == LOCKED else 'ball'}' style='background:{solid(color)}'></i>{name}</span>"
        for color, name in MARK_COLORS.items()
        if (colors == color).all(axis=1).any()
    ]
    if stepped_vertex(state) is not None:
        marks.append(f"<span><i class='ring' style='border-color:{solid(STEPPED)}'></i>last step</span>")
    if page_state.shows("paths") and page_state.magnification > 1 and state.moment > 0:
        marks.append(f"<span><i class='path' style='background:{PATH}'></i>paths ×{page_state.magnification:g}</span>")
    return f"<div class='lines marks'>{''.join(marks)}</div>" if marks else ""


def pull_arrows_html(found: MomentPulls, page_state: PageState, scale: float) -> str:
    """Markup: the terms whose arrows are drawn, in their order, and how much longer than the step these are."""
    chosen = chosen_vertices(page_state)
    drawn = [pull.name for pull in found.pulls if pull.step[chosen].any()]
    if not drawn:
        return ""
    colors = colors_of_terms(found.meanings)
    lines = [(name, colors[name]) for name in drawn] + [(f"next step ×{scale:g}", SELECTED)]
    dashes = "".join(f"<span><i style='background:{solid(color)}'></i>{text(name)}</span>" for name, color in lines)
    return f"<div class='lines'>{dashes}</div>"


def legend_html(legend: Legend) -> str:
    """Markup: title and colour scale with its ends and extremes; for categories their names and counts."""
    coloring = legend.coloring
    whose = "faces" if coloring.by_face else "vertices"
    parts = [f"<div class='legend'><b>{text(coloring.title)}</b>"]
    if legend.note:
        parts.append(f"<div class='dim'>{text(legend.note)}</div>")
    if coloring.scale is Scale.CATEGORY:
        parts += [_entry(color, name, str(count)) for name, color, count in legend.categories]
    elif legend.high > legend.low:
        parts.append(_wheel(legend) if coloring.scale is Scale.VECTOR else _bar(legend))
    elif legend.unknown == 0 or legend.largest:
        parts.append(_entry(_color(0), f"all {whose}", _value(legend.low, legend)))
    if legend.unknown:
        why = legend.why_unknown or coloring.unknown
        reason = f": {why}" if why else ""
        these = whose if legend.unknown > 1 else "face" if coloring.by_face else "vertex"
        parts.append(_entry(UNKNOWN, f"{legend.unknown} {these} unknown{reason}", ""))
    if legend.left_out:
        hidden = "little texture, or hidden" if coloring.scale is Scale.VECTOR else "hidden or near an outline"
        parts.append(_entry(UNKNOWN, f"{number(100 * legend.left_out, 2)} % of the pixels left out: {hidden}", ""))
    if legend.awaited:
        parts.append(f"<div class='selected'>Computing: {text(legend.awaited)}…</div>")
    elif legend.moment is not None:
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


def _wheel(legend: Legend) -> str:
    """Markup: the colours of all directions and lengths, with the length at the rim."""
    hues = ",".join(solid(color) for color in (*HUES, HUES[0]))
    colors = f"radial-gradient(closest-side,{solid(ZERO)},transparent),conic-gradient(from 90deg,{hues})"
    rim = f"{'≥ ' if legend.largest > legend.high else ''}{_value(legend.high, legend)}"
    return (
        f"<div class='row'><span class='wheel' style='background:{colors}'></span><span class='grow'>direction in the photo"
        f"<br>rim {rim}</span></div><div class='dim'>longest {_value(legend.largest, legend)}</div>"
    )


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
