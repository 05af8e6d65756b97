"""Self-contained HTML documents: no script, no further file, no network."""

import base64
import io
from collections.abc import Sequence

import numpy as np
from PIL import Image

from app.html import text
from app.palette import BACKGROUND, SELECTED, START, css, dark_variables, light_variables, solid

NEUTRAL = "var(--neutral)"

_STYLE = f"""
:root {{ color-scheme: dark light; {dark_variables()} --ground: {solid(BACKGROUND)}; --card: #212429; --neutral: #59636f; }}
@media print, (prefers-color-scheme: light) {{
  :root {{ {light_variables()} --ground: #fff; --card: #f3f5f7; --neutral: #98a2ad; }}
}}
* {{ box-sizing: border-box; }}
body {{ margin: 0; background: var(--ground); color: var(--text); font: 14px/1.5 system-ui, "DejaVu Sans", sans-serif;
  font-variant-numeric: tabular-nums; }}
main {{ max-width: 1240px; margin: 0 auto; padding: 28px 32px 60px; }}
h1 {{ font-size: 20px; margin: 0; color: var(--strong); overflow-wrap: anywhere; }}
h2 {{ font-size: 15px; margin: 34px 0 10px; color: var(--strong); }}
.dim {{ color: var(--dim); }}
.verdict {{ display: flex; gap: 18px; align-items: center; margin: 18px 0 0; padding: 14px 18px; border-radius: 8px;
  background: var(--card); border-left: 6px solid var(--c); }}
.verdict b {{ font-size: 20px; color: var(--c); }}
ul {{ margin: 0; padding: 0; list-style: none; display: grid; gap: 6px; }}
li {{ background: var(--card); border-radius: 6px; padding: 8px 14px; border-left: 3px solid var(--c); overflow-wrap: anywhere; }}
.tiles {{ display: grid; grid-template-columns: repeat(auto-fit, minmax(200px, 1fr)); gap: 12px; }}
.tiles.wide {{ grid-template-columns: repeat(auto-fit, minmax(300px, 1fr)); margin-top: 12px; }}
.tile {{ background: var(--card); border-radius: 8px; padding: 12px 14px; min-width: 0; }}
.tile b {{ display: block; font-size: 20px; line-height: 1.3; color: var(--strong); font-weight: 600; }}
.tile svg {{ display: block; width: 100%; height: 84px; margin-top: 8px; }}
.axis {{ display: flex; justify-content: space-between; font-size: 12px; color: var(--dim); }}
details {{ margin-top: 8px; }}
summary {{ cursor: pointer; }}
details p {{ margin: 4px 0 8px 18px; overflow-wrap: anywhere; }}
table {{ border-collapse: collapse; width: 100%; }}
th {{ text-align: right; font-weight: 400; color: var(--dim); padding: 4px 12px 6px; border-bottom: 1px solid var(--edge);
  vertical-align: bottom; }}
td {{ text-align: right; padding: 5px 12px; border-bottom: 1px solid var(--line); white-space: nowrap; }}
th:first-child, td:first-child {{ text-align: left; padding-left: 0; white-space: normal; overflow-wrap: anywhere; }}
td .name {{ display: block; width: max-content; max-width: 24ch; }}
td.bad {{ color: {css(SELECTED)}; font-weight: 600; }}
.bar {{ display: inline-block; vertical-align: middle; width: 64px; height: 6px; background: var(--line); border-radius: 3px;
  margin-left: 8px; }}
.bar i {{ display: block; height: 6px; border-radius: 3px; background: {css(START)}; }}
.legend {{ display: flex; gap: 6px 22px; flex-wrap: wrap; margin-bottom: 12px; }}
.legend i {{ display: inline-block; width: 18px; height: 3px; border-radius: 2px; vertical-align: middle; margin-right: 8px; }}
.photos {{ display: grid; grid-template-columns: repeat(auto-fill, minmax(360px, 1fr)); gap: 12px; }}
figure {{ margin: 0; background: var(--card); border-radius: 8px; overflow: hidden; }}
figure img {{ width: 100%; display: block; }}
figcaption {{ padding: 7px 12px 9px; display: flex; justify-content: space-between; gap: 10px; }}
figcaption b {{ color: var(--strong); font-weight: 600; overflow-wrap: anywhere; }}
figcaption span {{ white-space: nowrap; }}
@media screen and (max-width: 760px) {{
  main {{ padding: 18px 14px 40px; }}
  .verdict {{ flex-wrap: wrap; gap: 0 18px; }}
  .tiles, main .two {{ grid-template-columns: repeat(2, minmax(0, 1fr)); }}
  .tile {{ overflow-wrap: anywhere; }}
  .tile:last-child:nth-child(odd), .two > div {{ grid-column: span 2; }}
  main .tiles.wide {{ grid-template-columns: minmax(0, 1fr); }} .tiles.wide > .tile.tile {{ grid-column: auto; }}
  .photos {{ grid-template-columns: minmax(0, 1fr); }}
  figcaption {{ flex-wrap: wrap; }}
  table {{ display: block; overflow-x: auto; }}
  td {{ padding: 5px 8px; }}
  th:first-child, td:first-child {{ min-width: 72px; }}
}}
"""


def document(title: str, sections: Sequence[str], style: str = "") -> str:
    """The whole file as HTML.

    Args:
        sections: HTML, already escaped.
        style: further CSS rules.
    """
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{text(title)}</title><style>{_STYLE}{style}</style></head><body><main>"
        f"{''.join(sections)}</main></body></html>\n"
    )


def banner(head: str, meaning: str, color: str) -> str:
    """A verdict in one word, and its meaning."""
    return f"<div class='verdict' style='--c:{color}'><b>{text(head)}</b><span>{text(meaning)}</span></div>"


def bullets(title: str, items: Sequence[str], color: str) -> str:
    """Sentences under a title; nothing if there are none."""
    if not items:
        return ""
    lines = "".join(f"<li style='--c:{color}'>{text(item)}</li>" for item in items)
    return f"<h2>{text(title)}</h2><ul>{lines}</ul>"


def tile(value: str, label: str) -> str:
    """A large figure with a label."""
    return f"<div class='tile'><b>{text(value)}</b><span class='dim'>{text(label)}</span></div>"


def jpeg_uri(picture: np.ndarray) -> str:
    """A data URI with a JPEG of a picture (h, w, 3) uint8, RGB."""
    file = io.BytesIO()
    Image.fromarray(picture).save(file, format="JPEG", quality=82)
    return "data:image/jpeg;base64," + base64.b64encode(file.getvalue()).decode()
