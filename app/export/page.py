"""A run as one HTML file that replays it: opened by a double click, without a server, a network or a program.

The 3D view is our own, on WebGL 2, and not viser's player (`as_html`), although that is a library's: the player knows
neither textures that follow the mesh from moment to moment nor clicks on vertices, its clock can be set from outside only by
typing into its input field, and it weighs 0.8 MB. Here plot, cells, texts and mesh are functions of one number, the moment,
so they cannot drift apart; the file of the cube has 1 MB; and before and now are compared by a divider. What the page may
do is limited by a Content-Security-Policy that allows no request at all.
"""

import json
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any

from app.export.page_data import page_data
from app.export.run_facts import RunFacts
from app.export.run_tables import figures_table, options_list
from app.html import icon, text
from app.palette import BACKGROUND, BRAND, NOW, SELECTED, START, dark_variables, solid
from fairing.io import write_atomically

_SCRIPTS = ("plot.js", "viewer.js", "replay.js")
_POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:"


def write_page(facts: RunFacts, out: Path, at: int, on_progress: Callable[[float], None]) -> None:
    """Write the page; it opens at the moment `at`."""
    page = _page(facts, page_data(facts, at, on_progress))
    write_atomically(out, lambda file: file.write(page.encode()))


def _page(facts: RunFacts, data: dict[str, Any]) -> str:
    # Within a script element only "<" could end it.
    values = json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    scripts = "".join(f"<script>{_asset(name)}</script>" for name in _SCRIPTS)
    colors = f"--ground:{solid(BACKGROUND)};--panel:#1e2125;--brand:{solid(BRAND)};--selected:{solid(SELECTED)}"
    style = f":root{{{dark_variables()}{colors};--start:{solid(START)};--now:{solid(NOW)}}}\n{_asset('replay.css')}"
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{text(facts.scene.name)}: a fairing run</title><style>{style}</style></head><body>"
        f"{_header(facts)}{_VIEW}{_side(facts)}{_FOOTER}"
        f'<script type="application/json" id="data">{values}</script>{scripts}</body></html>\n'
    )


def _asset(name: str) -> str:
    return (files("app.export") / "web" / name).read_text(encoding="utf-8")


def _header(facts: RunFacts) -> str:
    mesh = facts.scene.mesh
    counts = (
        f"{facts.length} steps · {len(mesh.vertices)} vertices · {len(mesh.faces)} faces · {len(facts.scene.views)} photos"
    )
    return (
        f"<header><b title='{text(facts.scene.name)}'>{text(facts.scene.name)}</b>"
        f"<span class='dim one' title='{text(facts.title)}'>options: {text(facts.title)}</span><span class='grow'></span>"
        f"<span class='dim one'>{counts}</span></header>"
    )


_VIEW = """<section id="view">
<canvas id="scene" aria-label="The mesh in 3D. Drag to turn, scroll to zoom, click a vertex to select it"></canvas>
<div id="no-webgl" hidden>This browser shows no 3D here (WebGL 2 is switched off).<br>Plots, cells and texts work all the same.</div>
<div id="divider" hidden></div>
<div id="card"><div id="headline"></div><div id="where" class="dim"></div><div id="outcome"></div><div id="change" class="dim"></div></div>
<div id="sides" class="chips" role="group" aria-label="Which mesh is shown">
<button type="button" class="chip" data-side="before">Before</button><button type="button" class="chip" data-side="both">Both</button>
<button type="button" class="chip on" data-side="now">Now</button></div>
<div id="hint">drag: turn · shift-drag: move<br>wheel: zoom · click: vertex</div>
<div id="layers" class="chips" role="group" aria-label="What is drawn"></div>
</section>"""

_FOOTER = f"""<footer>
<button type="button" id="first" title="To the start (Home)" aria-label="To the start">{icon("start")}</button>
<button type="button" id="back" title="One step back (←)" aria-label="One step back">{icon("one", mirrored=True)}</button>
<button type="button" id="play" title="Play (Space)" aria-label="Play"><span class="run">{icon("run")}</span><span
 class="pause">{icon("pause")}</span></button>
<button type="button" id="forward" title="One step forward (→)" aria-label="One step forward">{icon("one")}</button>
<button type="button" id="last" title="To the end (End)" aria-label="To the end">{icon("start", mirrored=True)}</button>
<span id="moment"></span>
<div class="track"><input type="range" id="slider" min="0" max="0" step="1" aria-label="Moment"
 title="← → a step, Shift ← → a sweep, Home, End"><div id="bands"></div></div>
<select id="speed" title="Speed" aria-label="Speed"><option value="0.25">¼×</option><option value="0.5">½×</option>
<option value="1" selected>1×</option><option value="2">2×</option><option value="4">4×</option></select>
</footer>"""


def _side(facts: RunFacts) -> str:
    return f"""<aside><div id="plots"><div id="energy" class="plot"></div><div id="error" class="plot"></div></div>
<nav role="tablist"><button type="button" role="tab" class="on" data-tab="tab-cells" aria-selected="true">Cells</button>
<button type="button" role="tab" data-tab="tab-why" aria-selected="false">What happens</button>
<button type="button" role="tab" data-tab="tab-run" aria-selected="false">The run</button></nav>
<div class="page" id="tab-cells"><div id="no-cells" class="dim"></div>
<div id="cells"><div id="faces" class="chips"></div>
<div class="heads"><span></span><div><span title="A face as the photo shows it">observed I</span><span
 title="What the eigenspace makes of it">U c</span><span title="Blue: darker than explained; red: brighter">I − U c</span></div></div>
<div class="cells"><div id="cell-rows"></div><img id="sprite" alt="Cells of the face, a row a photo"></div>
<div class="dim" style="margin:6px 0 4px"><span id="cell-facts"></span> · residual in full colour at
 <span id="residual-scale"></span> grey levels</div>
<div class="chips"><span class="dim">cells at moment</span><span id="cell-moment" class="chips"></span></div></div></div>
<div class="page" id="tab-why" hidden><h2 id="what"></h2><p id="why"></p><p id="level-text" class="dim"></p>
<div id="vertex-facts"><h2 id="vertex-name"></h2><table id="vertex-rows"></table></div>
<h2>How to read this page</h2><p class="dim">Dots are vertices, the one looked at is yellow. Green is the start, red is now: paths run from
 green to red. The plots show the whole run; press or drag in them to go to a moment. In the cells, colour in the third column is
 what the eigenspace cannot explain: it fades as the vertex finds its place. Energies of two sweeps do not compare, because each
 sweep has cells of its own.</p></div>
<div class="page" id="tab-run" hidden>{figures_table(facts)}{options_list(facts.options)}</div></aside>"""
