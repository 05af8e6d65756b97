"""HTML elements of the panels: style sheet, buttons, tables, numbers, icons. Text from outside is escaped by `text`."""

import html
import json
from collections.abc import Iterable

from app.palette import BRAND, NOW, REFERENCE, REJECTED, SELECTED, START, css

STYLE = f"""
.ef {{ font-size: 12.5px; line-height: 1.45; color: var(--text); padding: 0 14px 8px 10px;
  font-variant-numeric: tabular-nums; }}
.ef .dim {{ color: var(--dim); }}
.ef .big {{ font-size: 14px; font-weight: 600; color: var(--strong); }}
.ef button {{ font: inherit; color: var(--text); background: var(--button); border: 1px solid var(--edge); border-radius: 4px;
  cursor: pointer; height: 28px; padding: 0 8px; display: inline-flex; align-items: center; justify-content: center;
  gap: 6px; }}
.ef button:hover:not(:disabled) {{ background: var(--hover); border-color: var(--hover-edge); }}
.ef button:active:not(:disabled) {{ background: var(--pressed); }}
.ef button:disabled {{ color: var(--faint); background: var(--off); border-color: var(--line); cursor: default; }}
.ef button:focus-visible {{ outline: 2px solid {css(BRAND)}; outline-offset: 1px; }}
.ef button.main:not(:disabled) {{ background: {css(BRAND)}; border-color: {css(BRAND)}; color: #fff; font-weight: 600; }}
.ef button.main:hover:not(:disabled) {{ background: #2460ac; }}
.ef svg {{ width: 16px; height: 16px; flex: none; }}
.ef kbd {{ font: 500 11.5px/1 inherit; font-family: inherit; order: 1; }}
.ef table {{ width: 100%; border-collapse: collapse; }}
.ef td, .ef th {{ padding: 2px 0; text-align: left; font-weight: 400; vertical-align: top; }}
.ef td.n {{ text-align: right; white-space: nowrap; }}
.ef th {{ color: var(--dim); }}
.ef .grid {{ display: grid; grid-template-columns: 50px repeat(5, 1fr); gap: 4px; align-items: center; }}
.ef .grid span {{ text-align: center; font-size: 11.5px; color: var(--dim); }}
.ef .grid span.left {{ text-align: left; }}
.ef .grid button {{ padding: 0; }}
.ef .line {{ display: flex; align-items: center; padding: 0 0 4px; cursor: default; }}
.ef .line span {{ width: 88px; flex: none; color: var(--dim); }}
.ef .line input {{ flex: 1; min-width: 0; height: 26px; padding: 0 6px; font: inherit; color: var(--text);
  background: var(--button); border: 1px solid var(--edge); border-radius: 4px; }}
.ef .line input:focus {{ outline: none; border-color: {css(BRAND)}; }}
.ef .row {{ display: flex; gap: 6px; align-items: center; }}
.ef .grow {{ flex: 1; }}
.ef .crumbs b {{ color: var(--strong); font-weight: 600; }}
.ef .crumbs i {{ font-style: normal; color: var(--dim); padding: 0 1px; }}
.ef .wide {{ width: 100%; }}
.ef .start {{ color: {css(START)}; }} .ef .now {{ color: {css(NOW)}; }}
.ef .selected {{ color: {css(SELECTED)}; }} .ef .rejected {{ color: {css(REJECTED)}; }}
.ef .layers {{ display: grid; grid-template-columns: 1fr 1fr; gap: 4px; }}
.ef .layer {{ justify-content: flex-start; text-align: left; }}
.ef .layers button {{ height: auto; min-height: 28px; line-height: 1.2; }}
.ef .layer.off {{ color: var(--off-text); background: var(--off); }}
.ef .segments {{ display: grid; grid-template-columns: repeat(auto-fit, minmax(84px, 1fr)); gap: 4px;
  margin: 3px 0; }} .ef .segments button {{ white-space: nowrap; }}
.ef .scales .segments {{ grid-template-columns: repeat(auto-fit, minmax(46px, 1fr)); }} .ef .scales button {{ padding: 0; }}
.ef .labels-above .segments {{ grid-template-columns: repeat(auto-fit, minmax(60px, 1fr)); }}
.ef .legend {{ display: grid; gap: 4px; }}
.ef .lines {{ display: flex; flex-wrap: wrap; gap: 2px 12px; }}
.ef .lines + .legend {{ margin-top: 8px; }}
.ef .lines span {{ display: inline-flex; align-items: center; gap: 5px; }}
.ef .lines i {{ width: 16px; height: 3px; border-radius: 1px; }}
.ef .scale {{ height: 12px; border-radius: 2px; }}
.ef .ends {{ display: flex; justify-content: space-between; }}
.ef .swatch {{ width: 10px; height: 10px; border-radius: 3px; flex: none; }}
.ef .kind .swatch {{ display: inline-block; margin-right: 3px; }}
.ef .pulls .swatch {{ display: inline-block; margin-right: 6px; }} .ef .pulls th.n {{ text-align: right; }}
.ef .pulls th {{ white-space: nowrap; }} .ef .pulls tr > * {{ padding: 1px 0 1px 6px; }}
.ef .pulls tr > :first-child {{ padding-left: 0; }}
.ef .pulls th.title {{ white-space: normal; font-weight: 600; color: var(--strong); }} .ef .pulls th.n {{ vertical-align: bottom; }}
 .ef .pulls tr:last-child > * {{ border-top: 1px solid var(--line); }}
.ef .photos {{ table-layout: fixed; }} .ef .photos th:first-child {{ width: 44%; }} .ef .photos th.n {{ text-align: right; }}
.ef .photos th {{ vertical-align: bottom; }}
.ef .result th:first-child {{ width: 62%; }}
.ef .layer.off .swatch {{ opacity: .35; }}
.ef .one {{ white-space: nowrap; overflow: hidden; text-overflow: ellipsis; }}
.ef .one > button.link {{ display: block; max-width: 100%; overflow: hidden; text-overflow: ellipsis; text-align: left; }}
.ef .pinned .one, .ef .kind .one, .ef .work-line {{ contain: inline-size; }}
.ef .work-line {{ display: flex; white-space: pre; overflow: hidden; }} .ef .work-line span {{ flex: none; }}
.ef .work-line span:first-child {{ flex: 0 1 auto; overflow: hidden; text-overflow: ellipsis; }}
.ef .strip {{ position: relative; flex: 1; height: 22px; background: var(--well); border-radius: 3px; cursor: pointer; }}
.ef .strip img {{ width: 100%; height: 100%; image-rendering: pixelated; border-radius: 3px; pointer-events: none; }}
.ef .strip i {{ position: absolute; top: -2px; bottom: -2px; width: 2px; margin-left: -1px;
  background: {css(SELECTED)}; }}
.ef .tools + .strip {{ margin-top: 6px; }} .ef .tools ~ .extent {{ margin: 3px 51px 0 0; gap: 0; }}
.ef .tools + .extent {{ margin-top: 6px; }}
.ef .extent > span {{ width: 110px; flex: none; color: var(--dim); font-size: 13px; }}
.ef .strip s {{ position: absolute; bottom: 0; width: 1px; background: #f1f3f5; pointer-events: none; }}
.ef .strip s.level {{ height: 100%; opacity: .75; }} .ef .strip s.sweep {{ height: 28%; opacity: .5; }}
.ef .stages {{ position: relative; flex: 1; height: 18px; background: var(--well); border-radius: 3px; }}
.ef .stage {{ position: absolute; top: 0; height: 18px; min-width: 3px; border-top: 3px solid; display: flex; flex-wrap: wrap;
  justify-content: center; overflow: hidden; text-overflow: ellipsis; cursor: pointer; container-type: inline-size; }}
.ef .stage + .stage {{ box-shadow: inset 1px 0 var(--line); }}
.ef .stage::before {{ content: ""; width: 0; height: 15px; }}
.ef .stage span {{ height: 15px; padding: 0 3px; font-size: 11px; line-height: 14px; color: var(--text); }}
.ef .stage span.short {{ display: none; }}
@container (max-width: 76px) {{ .ef .stage span.long {{ display: none; }} .ef .stage span.short {{ display: inline; }} }}
.ef .stage.now span {{ color: var(--strong); }}
.ef .stage.now {{ outline: 1px solid {css(SELECTED)}; outline-offset: -1px; }}
.ef button.in-stage {{ height: 20px; min-width: 0; padding: 0 4px; justify-content: flex-start; background: none;
  border-color: transparent; }} .ef button.in-stage .one {{ flex: 1; text-align: left; }}
.ef .crumbs {{ gap: 1px; margin: 0 0 1px -3px; white-space: nowrap; }}
.ef .crumbs button {{ height: auto; padding: 0 2px; background: none; border-color: transparent; gap: 4px; }}
.ef .crumbs .part {{ padding: 0 2px; }}
.ef .crumbs button.small {{ padding: 0 5px; }}
.ef .stack {{ display: grid; gap: 4px; }}
.ef code {{ font: 12px ui-monospace, "DejaVu Sans Mono", monospace; color: var(--strong); overflow-wrap: anywhere; }}
.ef .breakpoint {{ border-bottom: 1px solid var(--line); padding: 4px 0; }}
.ef button.small {{ height: 22px; padding: 0 6px; font-size: 11.5px; }}
.ef button.dot {{ height: 22px; width: 22px; padding: 0; color: {css(NOW)}; }}
.ef button.dot.off {{ color: var(--faint); }}
.ef .words td {{ color: var(--dim); padding-left: 10px; }} .ef .words th {{ color: var(--text); white-space: nowrap; }}
.ef .first {{ margin: 14px 0; }} .ef .first table {{ width: auto; }} .ef .first .words td {{ padding-left: 18px; }}
.ef .scroll {{ max-height: 112px; overflow-y: auto; margin-top: 6px; }}
.ef .runs td, .ef .runs th {{ padding: 2px 10px 2px 0; vertical-align: middle; }}
.ef .runs td:last-child {{ padding-right: 2px; }} .ef .runs th.n {{ text-align: right; }}
.ef .runs .current td, .ef .runs th {{ position: sticky; top: 0; z-index: 1; background: var(--mantine-color-body); }}
.ef .runs .current td {{ top: 22px; bottom: 0; }}
.ef .runs button, .ef .runs td:first-child {{ white-space: nowrap; }}
.ef .tools, .ef .tools .row {{ gap: 4px; }}
.ef .runs .what {{ width: 99%; max-width: 0; overflow: hidden; text-overflow: ellipsis; white-space: nowrap; }}
.ef button.small.on {{ border-color: {css(SELECTED)}; color: {css(SELECTED)}; }}
.ef button.small.a {{ background: {css(REFERENCE)}; border-color: {css(REFERENCE)}; color: var(--ink); }}
.ef .tag {{ border-radius: 3px; padding: 0 5px; color: var(--ink); }}
.ef .faces {{ flex-wrap: wrap; }}
.ef button.face {{ height: 24px; padding: 0 7px; }}
.ef button.face.on {{ border-color: {css(SELECTED)}; color: {css(SELECTED)}; }}
.ef .kinds {{ gap: 0; font-size: 11.5px; color: var(--dim); }}
.ef .kinds span {{ flex: none; }}
.ef .cell {{ padding: 3px 0 4px; border-top: 1px solid var(--line); }}
.ef .chips {{ gap: 4px; margin: 2px 0; flex-wrap: wrap; }}
.ef button.chip {{ height: 22px; padding: 0 7px; font-size: 11.5px; color: var(--dim); }}
.ef button.chip.tight {{ padding: 0 3.5px; }} .ef .chips:has(> .tight) {{ gap: 3px; }}
.ef .quantities.quantities {{ gap: 2px; }} .ef .quantities button.chip.tight {{ padding: 0 2px; font-size: 11px; }}
.ef .quantities.kind {{ flex-wrap: nowrap; font-size: 11.5px; margin-bottom: 4px; }}
.ef button.chip.on {{ border-color: {css(SELECTED)}; color: {css(SELECTED)}; }}
.ef button.link {{ background: none; border: none; height: 20px; padding: 0; color: var(--text); }}
.ef button.link:hover {{ color: var(--strong); text-decoration: underline; background: none; }}
.ef .tiles {{ position: relative; cursor: zoom-in; }}
.ef .tiles.square {{ aspect-ratio: 1; max-width: 100%; }}
.ef .tiles img {{ width: 100%; height: 100%; }} .ef img.pixels {{ image-rendering: pixelated; }}
.ef svg.over {{ position: absolute; inset: 0; width: 100%; height: 100%; pointer-events: none; }}
.ef svg.over path {{ fill: none; stroke-width: 1.2; stroke-linecap: round; stroke-linejoin: round; }}
.ef button.value {{ height: auto; padding: 0 2px; background: none; border: none; color: inherit;
  text-align: right; white-space: normal; }}
.ef button.value:hover {{ text-decoration: underline dotted; background: none; }}
.ef b.value {{ min-width: 58px; text-align: right; font-weight: 600; }}
.ef .crops {{ display: grid; grid-template-columns: 158px 158px; gap: 6px 10px; margin-top: 6px; }}
.ef .parts {{ display: grid; gap: 6px 8px; margin-top: 4px; }}
.ef .listing {{ background: var(--well); border: 1px solid var(--line); border-radius: 4px; padding: 4px 8px; margin: 8px 0;
  box-shadow: inset 2px 0 {css(SELECTED)}; }}
.ef .listing span {{ color: var(--dim); font-size: 11px; }}
.ef .listing code {{ display: block; padding: 0 0 0 calc(var(--indent) + 2ch); text-indent: -2ch; font-size: 11px;
  line-height: 1.45; white-space: pre-wrap; overflow-wrap: anywhere; color: var(--strong); background: none; }}
.ef .matrix {{ width: auto; margin: 4px 0; border: 1px solid var(--edge); border-width: 0 1px; border-radius: 4px; }}
.ef .matrix td {{ padding: 1px 8px; }}
.ef svg.ellipse {{ width: 100px; height: 100px; }} .ef .ellipse line {{ stroke: var(--line); }}
.ef .ellipse ellipse {{ fill: none; stroke: {css(SELECTED)}; stroke-width: 1.6; }}
.ef .charts {{ display: grid; grid-template-columns: 1fr 1fr; gap: 10px; margin-top: 4px; }}
.ef .bars .value {{ fill: var(--dim); }} .ef .bars .on {{ fill: var(--text); }}
.ef .bars .own {{ fill: var(--text); }} .ef .bars .chosen {{ fill: {css(SELECTED)}; }}
.ef img {{ display: block; }}
.ef .note {{ margin-top: 4px; }}
.ef .read-out {{ container-type: inline-size; }}
@container (max-width: 320px) {{ .ef .read-out div {{ min-height: 2lh; }} }}
.ef h4 {{ font-size: 12.5px; font-weight: 600; color: var(--strong); margin: 10px 0 2px; }}
.ef .plot {{ width: 100%; height: auto; background: var(--well); border: 1px solid var(--line); border-radius: 4px;
  cursor: pointer; display: block; }}
.ef div.plot {{ display: flex; align-items: center; justify-content: center; cursor: default; }}
.ef .plot text {{ font-size: 10.5px; fill: var(--dim); paint-order: stroke; stroke: var(--well); stroke-width: 3px; }}
.ef .plot.chart {{ cursor: default; }}
.ef .keys {{ display: grid; grid-template-columns: 1fr 1fr; gap: 0 28px; align-items: start; }}
.ef .dialog {{ position: relative; }}
.ef button.cross {{ position: absolute; top: -52px; right: -6px; z-index: 1001; width: 28px; padding: 0; }}
.ef pre {{ margin: 4px 0 0; font: 12px ui-monospace, "DejaVu Sans Mono", monospace; color: var(--strong);
  white-space: pre-wrap; overflow-wrap: anywhere; }}
.ef.suggestions {{ position: fixed; z-index: 200; padding: 4px; max-width: 320px; background: var(--button);
  border: 1px solid var(--edge); border-radius: 4px; box-shadow: 0 4px 16px rgb(0 0 0 / .35); }}
.ef.suggestions div {{ display: grid; padding: 3px 6px; border-radius: 3px; cursor: pointer; line-height: 1.25; }}
.ef.suggestions div:hover, .ef.suggestions [aria-selected=true] {{ background: var(--hover); }}
.ef.suggestions .dim {{ font-size: 11.5px; }}
.ef .bar {{ height: 3px; background: var(--line); border-radius: 2px; margin-top: 6px; }}
.ef .bar div {{ height: 3px; background: {css(BRAND)}; border-radius: 2px; }}
.ef .bar.work div {{ background: {css(NOW)}; }}
.ef .working {{ color: var(--strong); }}
"""


def text(value: object) -> str:
    """A value as text, with HTML special characters escaped."""
    return html.escape(str(value), quote=True)


def photo_title(view_id: int, name: str) -> str:
    """A photo's number, from 1 as on the keyboard, and its name."""
    return f"{view_id + 1} · {name}"


def box(content: str) -> str:
    """The element that gives a panel its fonts and colours."""
    return f'<div class="ef">{content}</div>'


def button(
    label: str,
    press: str,
    *,
    hint: str,
    icon: str = "",
    css_class: str = "",
    enabled: bool = True,
    pressed: bool | None = None,
    content: str = "",
) -> str:
    """A button. Its accessible name is its label or content; without both, the part of the hint before the first " (".

    Args:
        label: visible text; may be empty for a button with an icon.
        press: JavaScript from `HtmlEvents`.
        hint: tooltip.
        icon: SVG from `icon`.
        pressed: of a button that switches something on or off; None: it is no switch.
        content: HTML with visible text, in place of the label.
    """
    name = f'title="{text(hint)}"' + ("" if label or content else f' aria-label="{text(hint.split(" (")[0])}"')
    state = ("" if enabled else " disabled") + ("" if pressed is None else f' aria-pressed="{str(pressed).lower()}"')
    return (
        f'<button type="button" class="{css_class}" {name}{state} onclick="{text(press)}">'
        f"{icon}{content or text(label)}</button>"
    )


def copy_button(what: str, hint: str) -> str:
    """A button that copies text to the clipboard and is highlighted for 0.8 s."""
    press = f"ef.copy(this,{json.dumps(what)})"
    return button("", press, hint=hint, icon=icon("copy"), css_class="small")


def table(rows: list[tuple[str, str]]) -> str:
    """A table of names and values. Names are escaped; values are markup."""
    return (
        "<table>"
        + "".join(f"<tr><th>{text(name)}</th><td class='n'>{value}</td></tr>" for name, value in rows)
        + "</table>"
    )


def number(value: float, digits: int = 4) -> str:
    """A number with thin spaces between thousands and at most `digits` significant decimals: 12 345.6, 0.00123, 1.2e-07."""
    if value == 0:
        return "0"
    if not abs(value) < float("inf"):
        return text(value)
    if 1e-4 <= abs(value) < 1e7:
        decimals = max(0, digits - 1 - int(f"{abs(value):e}".split("e")[1]))
        return f"{value:,.{decimals}f}".replace(",", "\u2009").replace("-", "\u2212")
    return f"{value:.{digits - 1}e}".replace("-", "\u2212", 1) if value < 0 else f"{value:.{digits - 1}e}"


def numbers(values: Iterable[float], digits: int) -> str:
    """Numbers beside each other, see `number`; dots separate them, because a number may hold spaces."""
    return " · ".join(number(float(value), digits) for value in values)


def whole(value: int) -> str:
    """A whole number with thin spaces between thousands: 12 345."""
    return f"{value:,}".replace(",", "\u2009")


def duration(seconds: float) -> str:
    """A duration for reading: 12 s, 3 min 20 s, 1 h 5 min."""
    whole = max(0, round(seconds))
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"


_SHAPES = {
    "run": '<path d="M4 2.5v11l9.5-5.5z"/>',
    "pause": '<path d="M4 2.5h3v11h-3zM9 2.5h3v11h-3z"/>',
    "one": '<path d="M5.5 3v10l6-5z"/>',
    "two": '<path d="M2.5 3v10l5.5-5zM8.5 3v10l5.5-5z"/>',
    "bar": '<path d="M3.5 3v10l6-5zM10.5 3h2v10h-2z"/>',
    "bars_two": '<path d="M1.5 3v10l5-5zM6.5 3v10l5-5zM12 3h2v4.4h-2zM12 8.6h2v4.4h-2z"/>',
    "bars": '<path d="M1.5 3v10l5-5zM6.5 3v10l5-5zM12 3h2v10h-2z"/>',
    "restart": '<path d="M8 2.6a5.4 5.4 0 1 1-5.2 3.9l1.5.4a3.9 3.9 0 1 0 3.7-2.8v2.1l-3.6-2.8 3.6-2.9z"/>',
    "start": '<path d="M13 3v10l-6-5zM3.5 3h2v10h-2z"/>',
    "end": '<path d="M3 3v10l6-5zM10.5 3h2v10h-2z"/>',
    "into": '<path d="M6.8 1.5h2.4v5H12L8 11 4 6.5h2.8zM5.8 13.2a2.2 2.2 0 1 0 4.4 0z" transform="translate(0 .3)"/>',
    "go": '<path d="M2 7h7V3.5L14 8l-5 4.5V9H2z"/>',
    "eye": (
        '<path d="M8 3.5C4.6 3.5 2 6 1 8c1 2 3.6 4.5 7 4.5S14 10 15 8c-1-2-3.6-4.5-7-4.5z'
        'm0 7.2A2.7 2.7 0 1 1 8 5.3a2.7 2.7 0 0 1 0 5.4z"/>'
    ),
    "copy": (
        '<path d="M5.5 1.5h7a1 1 0 0 1 1 1v8h-1.5V3H5.5zM3.5 4.5h6a1 1 0 0 1 1 1v8a1 1 0 0 1-1 1h-6a1 1 0 0 1-1-1v-8'
        'a1 1 0 0 1 1-1zM4 6v7h5V6z"/>'
    ),
    "lock": '<path d="M4.5 7V5a3.5 3.5 0 0 1 7 0v2H13v7H3V7zm1.6 0h3.8V5a1.9 1.9 0 0 0-3.8 0z"/>',
    "unlock": '<path d="M4.5 7V4.2a3.5 3.5 0 0 1 6.9-.9l-1.5.4a1.9 1.9 0 0 0-3.8.5V7H13v7H3V7z"/>',
    "back": '<path d="M6.8 3v2.8H10a3.6 3.6 0 0 1 0 7.2H5v-1.6h5a2 2 0 0 0 0-4H6.8v2.8L2.5 6.6z"/>',
    "leave": '<path d="M4.2 3 3 4.2 6.8 8 3 11.8 4.2 13 8 9.2 11.8 13 13 11.8 9.2 8 13 4.2 11.8 3 8 6.8z"/>',
}


def icon(name: str, *, mirrored: bool = False) -> str:
    """An SVG icon in the colour of the text."""
    flip = ' style="transform:scaleX(-1)"' if mirrored else ""
    return f'<svg viewBox="0 0 16 16" fill="currentColor" aria-hidden="true"{flip}>{_SHAPES[name]}</svg>'
