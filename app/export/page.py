"""A run as one HTML file that replays it: opened by a double click, without a server, a network or a program.

The 3D view is our own, on WebGL 2, and not viser's player (`as_html`), although that is a library's: the player knows
neither textures that follow the mesh from moment to moment nor clicks on vertices, its clock can be set from outside only by
typing into its input field, and it weighs 0.8 MB. Here plot, cells, texts and mesh are functions of one number, the moment,
so they cannot drift apart, cells are computed for any of them, and before and now are compared by a divider. What the page may
do is limited by a Content-Security-Policy that allows no request at all.
"""

import json
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any

from app.export.page_data import page_data
from app.export.run_facts import RunFacts
from app.export.run_tables import figures_table, options_list
from app.html import icon, text
from app.palette import BACKGROUND, BRAND, GROUND, NOW, SELECTED, START, TRUTH, dark_variables, light_variables, solid
from fairing.io import write_atomically

_SCRIPTS = ("unpack.js", "plot.js", "viewer.js", "fourier.js", "photos.js", "eigenspace.js", "cells.js", "replay.js")


def write_page(facts: RunFacts, out: Path, at: int, on_progress: Callable[[float], None]) -> str:
    """Write the page; it opens at the moment `at`.

    Returns:
        What was left out to keep the file small; empty if nothing.
    """
    data = page_data(facts, at, on_progress)
    page = _page(facts, data)
    write_atomically(out, lambda file: file.write(page.encode()))
    kept, count = len(data["cells"]["faces"]), len(facts.scene.mesh.faces)
    return f"cells of {kept} of {count} faces, around the vertices that went farthest" if kept < count else ""


def _page(facts: RunFacts, data: dict[str, Any]) -> str:
    mesh = facts.scene.mesh
    colors = {
        "ground": BACKGROUND, "brand": BRAND, "selected": SELECTED, "start": START, "now": NOW, "truth": TRUTH,
    }  # fmt: skip
    counts = f"{facts.length} steps · {len(mesh.vertices)} vertices · {len(mesh.faces)} faces · {len(facts.scene.views)} photos"
    return Template(_asset("replay.html")).substitute(
        name=text(facts.scene.name),
        options=text(facts.title),
        counts=text(counts),
        colors=dark_variables() + "".join(f"--{name}:{solid(color)};" for name, color in colors.items()),
        light_colors=light_variables() + f"--ground:{solid(GROUND[1])};",
        style=_asset("replay.css"),
        run=figures_table(facts) + options_list(facts.options),
        # Within a script element only "<" could end it.
        data=json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c"),
        scripts="".join(f"<script>{_asset(name)}</script>" for name in _SCRIPTS),
        icon_start=icon("start"),
        icon_back=icon("one", mirrored=True),
        icon_run=icon("run"),
        icon_pause=icon("pause"),
        icon_forward=icon("one"),
        icon_end=icon("start", mirrored=True),
    )


def _asset(name: str) -> str:
    return (files("app.export") / "web" / name).read_text(encoding="utf-8")
