"""Tables of a run's figures and options, shared by the replay page and the report."""

from typing import Any

from app.debugger.option_fields import differing_fields, option_fields
from app.export.run_facts import RunFacts
from app.html import number, text
from fairing.options import PRESETS, FairingOptions

Rows = list[tuple[str, str]]


def figure_rows(report: dict[str, Any]) -> Rows:
    """Figures of the result from report.json: names, and values as markup."""
    rows: Rows = [("ended", text(_sentence(str(report["stop_reason"]))))]
    residual = report.get("residual", {})
    if residual.get("after") is not None:
        shown = f"{number(residual['before'], 4)} → <b>{number(residual['after'], 4)}</b>"
        rows.append(("residual at the finest level, grey levels", shown))
    for name, key, unit in (
        ("vertices to truth, rms, along directions the photos determine", "vertices_determined", "%"),
        ("vertices to truth, rms", "vertices_total", "%"),
        ("surface to true surface, mean", "surface_to_truth", "%"),
        (f"held-out sparse points to surface{_share(report)}, median", "sparse_points_to_surface", "%"),
    ):
        found = report.get("quality", {}).get(key)
        if found and "before" in found:
            which = "rms_percent" if "rms" in name else "median_percent" if "median" in name else "mean_percent"
            rows.append(
                (name, f"{number(found['before'][which], 3)} → <b>{number(found['after'][which], 3)}</b> {unit}")
            )
    off = report.get("quality", {}).get("reprojection_px")
    if off:
        rows.append(
            (
                "vertices to truth in the photos, rms",
                f"{number(off['before']['rms'], 3)} → <b>{number(off['after']['rms'], 3)}</b> px",
            )
        )
    left_out = report.get("left_out")
    if left_out and left_out.get("photos_judged"):
        rows.append(
            (
                f"held-out photos, PSNR (mean of {left_out['photos_judged']})",
                f"{left_out['psnr_before']:.2f} → <b>{left_out['psnr_after']:.2f}</b> dB",
            )
        )
        rows.append(("held-out photos, SSIM", f"{left_out['ssim_before']:.4f} → <b>{left_out['ssim_after']:.4f}</b>"))
    return rows


def _share(report: dict[str, Any]) -> str:
    """How many of the held-out points belong to the surface; empty in reports without the numbers."""
    found = report.get("quality", {}).get("sparse_points_to_surface", {})
    return f" ({found['on_surface']} of {found['held_out']} belong to it)" if "on_surface" in found else ""


def machine_rows(report: dict[str, Any]) -> Rows:
    """Rows of run time, samples read and versions."""
    rows: Rows = []
    if report["seconds"].get("loading") is not None:
        rows.append(("time", f"{report['seconds']['total']:.1f} s"))
        rows.append(("cell samples read", f"{report['samples'] / 1e6:,.0f} million".replace(",", "\u2009")))
    rows += [(text(name), text(value)) for name, value in report["versions"].items() if value is not None]
    return rows


def table(rows: Rows) -> str:
    """Markup of a table with names and values."""
    return "<table>" + "".join(f"<tr><th>{text(name)}</th><td>{value}</td></tr>" for name, value in rows) + "</table>"


def figures_table(facts: RunFacts) -> str:
    """Markup of figures, notes, time and versions."""
    report = facts.report
    notes = "".join(f"<p class='dim'>{text(note)}</p>" for note in report["warnings"])
    return (
        f"<h2>Figures</h2>{table(figure_rows(report))}<p class='dim'>% of the mesh's diagonal.</p>"
        f"{'<h2>Notes</h2>' + notes if notes else ''}<h2>Time and versions</h2>{table(machine_rows(report))}"
    )


def options_list(options: FairingOptions) -> str:
    """Markup of all options with their meanings; options that differ from the nearest preset are marked."""
    fields = option_fields()
    changed = {name: differing_fields(preset, options) for name, preset in PRESETS.items()}
    nearest = min(changed, key=lambda name: len(changed[name]))
    parts = [f"<h2>Options</h2><p class='dim'>Preset {nearest}; {len(changed[nearest])} options differ from it.</p>"]
    for group in dict.fromkeys(field.group for field in fields):
        members = [field for field in fields if field.group == group]
        items = "".join(
            f"<div class='option{' changed' if field in changed[nearest] else ''}'><b>{text(field.label)}</b> = "
            f"{text(_shown(field.shown(options)))}<small>{text(field.meaning)}</small></div>"
            for field in members
        )
        is_open = " open" if any(field in changed[nearest] for field in members) else ""
        parts.append(f"<details{is_open}><summary>{text(group.capitalize())}</summary>{items}</details>")
    return "".join(parts)


def _shown(value: Any) -> str:
    if isinstance(value, bool):
        return "on" if value else "off"
    return "none" if value == "" else str(value)


def _sentence(line: str) -> str:
    return line[:1].upper() + line[1:]
