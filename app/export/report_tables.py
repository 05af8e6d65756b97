"""Tables of a run's report, from the contents of report.json."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2

from app.files.document import jpeg_uri
from app.html import number, text
from fairing.photo import FilePhoto
from fairing.stage_kind import StageKind

LEFT_OUT_WIDTH = 1280  # px at most
MOST_ROWS = 20
_LEFT_OUT_KEYS = (("psnr_before", 2), ("psnr_after", 2), ("ssim_before", 4), ("ssim_after", 4))


def levels_table(report: dict[str, Any]) -> str:
    """Markup of a table with a row per level."""
    rows = []
    for level in sorted({sweep["level"] for sweep in report["sweeps"]}):
        sweeps = [sweep for sweep in report["sweeps"] if sweep["level"] == level]
        first, last = sweeps[0], sweeps[-1]
        rows.append(
            _row(
                str(level + 1),
                f"{first['blur_px']:g} px",
                str(len(sweeps)),
                str(sum(sweep["steps"] for sweep in sweeps)),
                str(sum(sweep["accepted"] for sweep in sweeps)),
                f"{number(max(sweep['longest_step_px'] for sweep in sweeps), 3)} px",
                f"{number(first['before'])} → {number(first['after'])}",
                f"{number(last['before'])} → {number(last['after'])}",
            )
        )
    names = (
        "level",
        "blur",
        "sweeps",
        "steps",
        "accepted",
        "longest step",
        "sweep energy, first",
        "sweep energy, last",
    )
    return _table("Levels", names, rows)


def stages_table(report: dict[str, Any]) -> str:
    """Markup of a table with a row per stage; empty for reports of versions that did not list them."""
    stages = report.get("stages", [])
    rows = [
        _row(
            text(StageKind[stage["kind"].upper()].label),
            str(stage["level"] + 1),
            str(stage["steps"]),
            f"{number(100 * stage['objective_left'], 3)} %" if "objective_left" in stage else "–",
            number(stage["residual"], 4) if "residual" in stage else "–",
        )
        for stage in stages
    ]
    return _table(
        "Stages", ("stage", "level", "steps", "objective left by the fit", "residual after it, grey levels"), rows
    )


def left_out_table(report: dict[str, Any], picture: Path | None) -> str:
    """Markup of a table of held-out photos, and the picture of their errors if it exists; empty without held-out photos.

    Raises:
        InputError: the picture cannot be read.
    """
    found = report.get("left_out")
    if not found:
        return ""
    rows = [
        _row(text(photo["photo"]), *(_or_dash(photo[key], digits) for key, digits in _LEFT_OUT_KEYS))
        for photo in found["photos"]
    ]
    names = ("photo", "PSNR before, dB", "after", "SSIM before", "after")
    return _table("Held-out photos, predicted from the others", names, rows) + (
        _sheet(picture) if picture is not None and picture.exists() else ""
    )


def vertices_table(report: dict[str, Any]) -> str:
    """Markup of two tables: reasons of the last steps, and the vertices that moved most."""
    vertices, diagonal = report["vertices"], report["scene"]["diagonal"]
    reasons = Counter(vertex["stop_reason"] for vertex in vertices)
    most = max(reasons.values(), default=1)
    why = [_row(text(reason), f"{count}{_bar(count / most)}") for reason, count in reasons.most_common()]
    farthest = sorted(vertices, key=lambda vertex: -vertex["moved"])[:MOST_ROWS]
    rows = [
        _row(
            text(", ".join(map(str, vertex["input_vertices"]))),
            f"{number(100 * vertex['moved'] / diagonal, 3)} %",
            str(vertex["views"]),
            _ratio(vertex["eigenvalues"]),
            text(vertex["stop_reason"]),
        )
        for vertex in farthest
    ]
    title = "All vertices" if len(rows) == len(vertices) else f"The {len(rows)} vertices that moved most"
    names = ("vertex", "moved, of the diagonal", "photos", "weakest / strongest eigenvalue", "last step")
    return _table("Last steps of the vertices by reason", ("reason", "vertices"), why) + _table(title, names, rows)


def seconds_table(report: dict[str, Any]) -> str:
    """Markup of a table of times by stage; empty if they were not recorded."""
    seconds = report["seconds"]
    if seconds.get("loading") is None:
        return ""
    stages = [(name, value) for name, value in seconds.items() if name != "total" and value > 0]
    most = max([value for _, value in stages], default=1.0)
    rows = [_row(text(name), f"{value:.2f} s{_bar(value / most)}") for name, value in stages]
    return _table(f"Time: {seconds['total']:.1f} s", ("stage", "seconds"), rows)


def _table(title: str, names: Sequence[str], rows: Sequence[str]) -> str:
    if not rows:
        return ""
    header = "".join(f"<th>{text(name)}</th>" for name in names)
    return f"<h2>{text(title)}</h2><table><thead><tr>{header}</tr></thead><tbody>{''.join(rows)}</tbody></table>"


def _row(*cells: str) -> str:
    return "<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>"


def _bar(share: float) -> str:
    return f"<span class='bar'><i style='width:{100 * share:.0f}%'></i></span>"


def _ratio(eigenvalues: list[float] | None) -> str:
    return "–" if not eigenvalues or not eigenvalues[2] else number(eigenvalues[0] / eigenvalues[2], 2)


def _or_dash(value: float | None, digits: int) -> str:
    return "–" if value is None else f"{value:.{digits}f}"


def _sheet(path: Path) -> str:
    image = FilePhoto(path).load()
    scale = min(1.0, LEFT_OUT_WIDTH / image.shape[1])
    small = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    return f"<img class='whole' alt='Errors of the held-out photos, before and after' src='{jpeg_uri(small)}'>"
