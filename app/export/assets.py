"""Assets of exported pages: scripts, style sheets, data and theme colours as parts of one HTML file."""

import json
from importlib.resources import files
from string import Template
from typing import Any

from app.html import icon, text
from app.palette import BACKGROUND, BRAND, GROUND, NOW, SELECTED, START, TRUTH, dark_variables, light_variables, solid
from app.scripts import script

# Nothing may be requested: scripts, styles and pictures are parts of the file.
_STATIC_POLICY = "default-src 'none'; style-src 'unsafe-inline'"
_SCRIPT_POLICY = f"{_STATIC_POLICY}; script-src 'unsafe-inline'; img-src data:"


def offline_document(
    title: str, about: str, style: str, body: str, data: dict[str, Any] | None = None, module: str = ""
) -> str:
    """A complete HTML document that makes no request, in the theme of the browser.

    Args:
        title, about: title and description, plain text.
        style: CSS rules after those of the theme's colours.
        body: markup.
        data: what the script reads, as the element `data`; None: the document has no script.
        module: of the script; see `app.scripts.script`.
    """
    if data is not None:
        body += f'<script type="application/json" id="data">{_json(data)}</script>\n<script>{script(module)}</script>'
    return Template(asset("document.html")).substitute(
        _theme_colors(),
        policy=_STATIC_POLICY if data is None else _SCRIPT_POLICY,
        title=text(title),
        about=text(about),
        style=style,
        body=body,
    )


def time_buttons(back: str, forward: str) -> str:
    """Markup of the buttons that go through a run, for `app/web/playback.js`; `back`, `forward`: the keys of two of them."""
    return Template(asset("time_buttons.html", "app")).substitute(
        key_back=back,
        key_forward=forward,
        icon_start=icon("start"),
        icon_back=icon("one", mirrored=True),
        icon_run=icon("run"),
        icon_pause=icon("pause"),
        icon_forward=icon("one"),
        icon_end=icon("start", mirrored=True),
    )


def asset(name: str, package: str = "app.export") -> str:
    """The text of a file in the folder `web` of a package."""
    return (files(package) / "web" / name).read_text(encoding="utf-8")


def _json(data: dict[str, Any]) -> str:
    """JSON for a script element; "<" is escaped because it could end the element."""
    return json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def _theme_colors() -> dict[str, str]:
    """CSS variables of a page: `colors` of the dark theme, and `light_colors`, which replace them in the light theme."""
    colors = {
        "ground": BACKGROUND, "brand": BRAND, "selected": SELECTED, "start": START, "now": NOW, "truth": TRUTH,
    }  # fmt: skip
    return {
        "colors": dark_variables() + "".join(f"--{name}:{solid(color)};" for name, color in colors.items()),
        "light_colors": light_variables() + f"--ground:{solid(GROUND[1])};",
    }
