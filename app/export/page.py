"""Replay page: a run as one HTML file that opens without a server, a network connection or a program.

The 3D view is implemented in `web/viewer.js` on WebGL 2. viser's player (`as_html`) is not used: it supports neither
textures that change with the moment nor clicks on vertices, it has no interface to set the moment, and it is larger
(ledger: replay viewer). Plots, cells, texts and mesh are functions of the moment alone, so they are always consistent.
A Content-Security-Policy forbids all requests.
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

    Args:
        on_progress: called with the fraction that is done.

    Returns:
        A note on faces whose cells are not in the file, to limit its size; empty if all cells are.
    """
    data = page_data(facts, at, on_progress)
    page = _page(facts, data)
    write_atomically(out, lambda file: file.write(page.encode()))
    kept, count = len(data["cells"]["faces"]), len(facts.scene.mesh.faces)
    return f"cells of {kept} of {count} faces, around the vertices that moved most" if kept < count else ""


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
        # "<" is escaped because it could end the script element.
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
