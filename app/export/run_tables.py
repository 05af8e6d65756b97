"""A run's figures and options as tables, the same in the replay page and in the report."""

from typing import Any

from app.debugger.option_fields import option_fields
from app.export.run_facts import RunFacts
from app.html import number, text
from fairing.options import PRESETS, FairingOptions

Rows = list[tuple[str, str]]


def figure_rows(report: dict[str, Any]) -> Rows:
    """What report.json says of the result: names and values, values as markup."""
    rows: Rows = [("ended", text(_sentence(str(report["stop_reason"]))))]
    for name, key, unit in (
        ("vertices to their true places, rms, what photos determine", "vertices_determined", "%"),
        ("vertices to their true places, rms", "vertices_total", "%"),
        ("surface to the true surface, mean", "surface_to_truth", "%"),
        ("sparse points kept to judge by, to the surface, median", "sparse_points_to_surface", "%"),
    ):
        found = report.get("quality", {}).get(key)
        if found:
            which = "rms_percent" if "rms" in name else "median_percent" if "median" in name else "mean_percent"
            rows.append(
                (name, f"{number(found['before'][which], 3)} → <b>{number(found['after'][which], 3)}</b> {unit}")
            )
    off = report.get("quality", {}).get("reprojection_px")
    if off:
        rows.append(
            (
                "the same seen in the photos, rms",
                f"{number(off['before']['rms'], 3)} → <b>{number(off['after']['rms'], 3)}</b> px",
            )
        )
    left_out = report.get("left_out")
    if left_out and left_out.get("photos_judged"):
        rows.append(
            (
                f"photos left out, PSNR (mean of {left_out['photos_judged']})",
                f"{left_out['psnr_before']:.2f} → <b>{left_out['psnr_after']:.2f}</b> dB",
            )
        )
        rows.append(("photos left out, SSIM", f"{left_out['ssim_before']:.4f} → <b>{left_out['ssim_after']:.4f}</b>"))
    return rows


def machine_rows(report: dict[str, Any]) -> Rows:
    """Time and versions."""
    rows: Rows = []
    if report["seconds"].get("loading") is not None:
        rows.append(("time", f"{report['seconds']['total']:.1f} s"))
        rows.append(("cell samples read", f"{report['samples'] / 1e6:,.0f} million".replace(",", "\u2009")))
    rows += [(text(name), text(value)) for name, value in report["versions"].items() if value is not None]
    return rows


def table(rows: Rows) -> str:
    """Names and values side by side."""
    return "<table>" + "".join(f"<tr><th>{text(name)}</th><td>{value}</td></tr>" for name, value in rows) + "</table>"


def figures_table(facts: RunFacts) -> str:
    """Figures, notes and versions, as markup."""
    report = facts.report
    notes = "".join(f"<p class='dim'>{text(note)}</p>" for note in report["warnings"])
    return (
        f"<h2>Figures</h2>{table(figure_rows(report))}<p class='dim'>Percent of the mesh's diagonal.</p>"
        f"{'<h2>Notes</h2>' + notes if notes else ''}<h2>Made by</h2>{table(machine_rows(report))}"
    )


def options_list(options: FairingOptions) -> str:
    """Every option with its meaning, those that differ from the nearest preset marked, as markup."""
    fields = option_fields()
    changed = {name: [f for f in fields if f.of(preset) != f.of(options)] for name, preset in PRESETS.items()}
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
