"""Report on a run: one printable HTML file without scripts.

It is written by `export RUN --out report.html --report`, not by `fair`: rendering the mesh takes seconds that a batch of
runs does not need, and any recorded run, also a cancelled one, can be reported later.
"""

from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from app.export.charts import curve_chart
from app.export.picture import TEXELS, framed
from app.export.report_tables import left_out_table, levels_table, seconds_table, stages_table, vertices_table
from app.export.run_facts import RunFacts
from app.export.run_tables import figure_rows, machine_rows, options_list, table
from app.export.texture_keyframes import KeyframeRenderer, texture_keyframes
from app.files.document import NEUTRAL, banner, bullets, document, jpeg_uri, tile
from app.files.run_files import LEFT_OUT
from app.html import number, text
from app.palette import BACKGROUND, BRAND, NOW, SELECTED, START, TRUTH, css
from fairing.io import write_atomically
from fairing.stage_kind import StageKind

PICTURE = 600  # px
STYLE = f"""
.two {{ display: grid; grid-template-columns: 1fr 1fr; gap: 12px; }}
.two > div {{ background: var(--card); border-radius: 8px; padding: 12px 14px; min-width: 0; }}
.curve {{ width: 100%; display: block; margin-top: 8px; }}
.curve text {{ fill: var(--dim); font-size: 12px; }}
.plain th {{ border-bottom: 1px solid var(--line); text-align: left; padding: 5px 12px 5px 0; font-weight: 400; }}
.plain td {{ white-space: normal; }}
.option {{ margin: 4px 0 6px 18px; padding-left: 10px; border-left: 2px solid var(--line); overflow-wrap: anywhere; }}
.option.changed {{ border-color: {css(SELECTED)}; }}
.option small {{ display: block; color: var(--dim); }}
.whole {{ width: 100%; display: block; margin-top: 12px; border-radius: 8px; }}
@media screen and (max-width: 760px) {{ .curve text {{ font-size: 15.5px; }} }}
@media print {{ body {{ print-color-adjust: exact; }} h2, figure, .two, tr {{ break-inside: avoid; }} }}
"""


def write_report(facts: RunFacts, out: Path, on_progress: Callable[[float], None]) -> None:
    """Write the report.

    Raises:
        InputError: the run's report.json is damaged, or a photo is missing.
    """
    page = document(f"{facts.scene.name}: report of a run", _sections(facts, on_progress), STYLE)
    write_atomically(out, lambda file: file.write(page.encode()))


def _sections(facts: RunFacts, on_progress: Callable[[float], None]) -> list[str]:
    assert facts.folder is not None, "a report is written of a run's folder"
    report, mesh = facts.report, facts.scene.mesh
    counts = f"{len(mesh.vertices)} vertices, {len(mesh.faces)} faces, {len(facts.scene.views)} photos"
    head, _, rest = str(report["stop_reason"]).partition(": ")
    return [
        f"<h1>{text(facts.scene.name)}</h1><div class='dim'>{counts}; options: {text(facts.title)}</div>",
        banner(head.capitalize(), rest, css(START if report["finished"] else SELECTED)),
        _tiles(facts, report),
        _pictures(facts, on_progress),
        _curves(facts),
        stages_table(report),
        levels_table(report),
        f"<h2>Figures</h2><div class='plain'>{table(figure_rows(report))}</div>"
        "<p class='dim'>% of the mesh's diagonal, before → after.</p>",
        left_out_table(report, None if facts.folder is None else facts.folder / LEFT_OUT),
        vertices_table(report),
        bullets("Notes", report["warnings"], css(BRAND)),
        bullets("Not used", _skipped(report), NEUTRAL),
        seconds_table(report),
        f"<h2>Time and versions</h2><div class='plain'>{table(machine_rows(report))}</div>",
        options_list(facts.options),
    ]


def _tiles(facts: RunFacts, report: dict[str, Any]) -> str:
    moved = np.array([vertex["moved"] for vertex in report["vertices"]])
    diagonal = report["scene"]["diagonal"]
    before, after = facts.residual(0).mean, facts.residual(facts.length).mean
    change = f"{_signed(100 * (after - before) / before)} %" if before > 0 else "–"
    tiles = [
        tile(change, f"residual at the finest level, grey levels: {_figure(before)} → {_figure(after)}"),
        tile(f"{int((moved > 0).sum())} of {len(moved)}", "vertices moved"),
        tile(
            f"{number(100 * float(np.median(moved)) / diagonal, 3)} %",
            "of the diagonal: median displacement of a vertex",
        ),
    ]
    if facts.errors is not None:
        label = f"of the diagonal: RMS distance to the truth; at the start {number(float(facts.errors[0]), 3)} %"
        tiles.insert(0, tile(f"{number(float(facts.errors[-1]), 3)} %", label))
    else:
        tiles.append(tile(str(facts.length), f"steps on {facts.options.n_levels} levels"))
    return f"<h2>Summary</h2><div class='tiles'>{''.join(tiles)}</div>"


def _figure(value: float) -> str:
    return number(value, 4).replace("\u2009", " ")


def _signed(value: float) -> str:
    return ("+" if value > 0 else "") + number(value, 3)


def _pictures(facts: RunFacts, on_progress: Callable[[float], None]) -> str:
    moments = sorted({0, facts.length})
    camera = framed(facts, moments, PICTURE)
    renderer = KeyframeRenderer(facts, texture_keyframes(facts, moments, TEXELS, on_progress), camera, BACKGROUND)
    figures = "".join(
        f"<figure><img alt='The mesh {name}' src='{jpeg_uri(renderer.draw(moment))}'><figcaption><b>{name.capitalize()}</b>"
        f"<span class='dim'>{text(words)}</span></figcaption></figure>"
        for name, moment, words in (("before", 0, "the start"), ("after", facts.length, f"{facts.length} steps later"))
    )
    return f"<h2>Mesh</h2><div class='two'>{figures.replace('<figure>', '<figure style=padding:0>')}</div>"


def _curves(facts: RunFacts) -> str:
    if facts.length == 0:
        return ""
    blur = facts.options.by_level("blur")
    bands = [
        (stage.begin, stage.end, f"σ {blur[stage.level]:g}" if stage.kind is StageKind.PHOTOS else stage.kind.label)
        for stage in facts.energies.stages(facts.length)
    ]
    charts = []
    if len(facts.residual_line.moments):
        title = "Residual at the finest level, grey levels: the same faces, photos and samples at all moments"
        chart = curve_chart([facts.residual_line], bands, facts.length, NOW, "Residual by moment")
        charts.append(f"<div>{title}{chart}</div>")
    if facts.errors is not None:
        line = (np.arange(len(facts.errors)), facts.errors)
        chart = curve_chart([line], bands, facts.length, TRUTH, "Error by moment", is_log=True)
        charts.append(
            f"<div>RMS distance of the vertices to the truth along directions the photos determine, % of the diagonal{chart}"
            "</div>"
        )
    energy = ""
    if facts.energy_lines:
        why = "One line per sweep: each has its own cells, blur and robust scale, so energies of different sweeps do not compare."
        chart = curve_chart(facts.energy_lines, bands, facts.length, NOW, "Energy of the sweeps by moment")
        energy = (
            f"<details><summary>Expert's view: energy of the sweeps</summary><p class='dim'>{why}</p>{chart}</details>"
        )
    return f"<h2>Progress</h2><div class='two'>{''.join(charts)}</div>{energy}"


def _skipped(report: dict[str, Any]) -> list[str]:
    """Faces and vertices that were not used, by reason."""
    skipped = report["skipped"]
    lines = []
    if skipped["faces"]:
        lines.append(
            f"{len(skipped['faces'])} faces are not used at the last level: fewer than three photos see them well enough"
        )
    if skipped["faces_with_fewer_dimensions"]:
        lines.append(
            f"{len(skipped['faces_with_fewer_dimensions'])} faces have a smaller k because few photos see them"
        )
    reasons = Counter(vertex["reason"] for vertex in skipped["vertices"])
    return lines + [f"{count} vertices {reason}" for reason, count in reasons.most_common()]
