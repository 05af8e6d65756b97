"""Replay page: a run as one HTML file that opens without a server, a network connection or a program.

The 3D view is implemented in `web/viewer.js` on WebGL 2. viser's player (`as_html`) is not used: it supports neither
textures that change with the moment nor clicks on vertices, it has no interface to set the moment, and it is larger
(ledger: replay viewer). Plots, cells, texts and mesh are functions of the moment alone, so they are always consistent.
A Content-Security-Policy forbids all requests.
"""

from collections.abc import Callable
from pathlib import Path
from string import Template
from typing import Any

from app.export.assets import asset, offline_document, time_buttons
from app.export.page_data import page_data
from app.export.run_facts import RunFacts
from app.export.run_tables import figures_table, options_list
from app.html import text
from fairing.io import write_atomically
from fairing.run.recorded_terms import has_terms_of_trace


def write_page(facts: RunFacts, out: Path, at: int, on_progress: Callable[[float], None]) -> str:
    """Write the page; it opens at the moment `at`.

    Args:
        on_progress: called with the fraction that is done.

    Returns:
        A note on what is not in the file: cells, to limit its size, and pulls without the code of the run's own terms; empty if
        all is.
    """
    data = page_data(facts, at, on_progress)
    write_atomically(out, lambda file: file.write(_page(facts, data).encode()))
    kept, count = len(data["cells"]["faces"]), len(facts.scene.mesh.faces)
    notes = [f"cells of {kept} of {count} faces, around the vertices that moved most"] if kept < count else []
    if not has_terms_of_trace(facts.trace, facts.session.terms):
        notes.append("without pulls: give the files of the run's own terms with --with")
    return "; ".join(notes)


def page_of(facts: RunFacts, at: int, on_progress: Callable[[float], None]) -> str:
    """The page as text; see `write_page`."""
    return _page(facts, page_data(facts, at, on_progress))


def _page(facts: RunFacts, data: dict[str, Any]) -> str:
    mesh = facts.scene.mesh
    counts = f"{facts.length} steps · {len(mesh.vertices)} vertices · {len(mesh.faces)} faces · {len(facts.scene.views)} photos"
    body = Template(asset("replay.html")).substitute(
        name=text(facts.scene.name),
        options=text(facts.title),
        counts=text(counts),
        run=figures_table(facts) + options_list(facts.options),
        time_buttons=time_buttons("←", "→"),
    )
    title = f"{facts.scene.name}: a fairing run"
    return offline_document(
        title, facts.title, asset("page.css", "app") + asset("replay.css"), body, data, "export/web/replay.js"
    )
