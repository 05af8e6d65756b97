"""`check`: the findings on the terminal, and as a page with the mesh drawn over every photo."""

from pathlib import Path
from urllib.parse import quote

import numpy as np
from PIL import Image
from rich.console import Console
from rich.table import Table

from app.cli.loading import load_with_progress
from app.files.check_page import VERDICTS, check_page
from app.files.json_file import write_json
from app.files.scene_source import SceneSource
from app.pictures.check_pictures import THUMBNAIL, contact_sheet, overlay
from fairing.check.result import SceneCheck
from fairing.check.scene_check import check_scene
from fairing.io import prepare_output_folder, write_atomically
from fairing.io.capture import listed
from fairing.scene import Scene

PAGE, DATA, SHEET = "check.html", "check.json", "contact-sheet.png"


def check_to_console(source: SceneSource, out: Path | None, console: Console) -> int:
    """Print the findings; with `out`, write them as a page, as JSON and as pictures, too.

    Returns:
        Exit code: 1 if the input cannot be used.
    """
    scene = load_with_progress(source, console)
    if out is not None:
        prepare_output_folder(out)
    check = check_scene(scene)
    _print(scene, check, console)
    if out is not None:
        _write(scene, check, out)
        console.print(
            f"wrote {out / PAGE}, {DATA}, {SHEET} and {len(scene.views)} overlays",
            highlight=False, soft_wrap=True, markup=False,
        )  # fmt: skip
    return 1 if check.verdict == "unusable" else 0


def _write(scene: Scene, check: SceneCheck, out: Path) -> None:
    thumbnails, files = [], []
    for v, view in enumerate(scene.views):
        image = Image.fromarray(overlay(scene, check, v))
        files.append(f"overlay-{view.name.replace('/', '_')}.png")
        write_atomically(out / files[-1], lambda file, image=image: image.save(file, format="PNG", compress_level=3))
        thumbnails.append(overlay(scene, check, v, THUMBNAIL))
    sheet = contact_sheet(thumbnails, [f"{view.name}: {view.faces} faces" for view in check.views])
    write_atomically(out / SHEET, lambda file: sheet.save(file, format="PNG"))
    page = check_page(scene, check, thumbnails, [quote(file) for file in files])
    write_atomically(out / PAGE, lambda file: file.write(page.encode()))
    write_json(out / DATA, check.as_dict())


def _print(scene: Scene, check: SceneCheck, console: Console) -> None:
    columns = ("photo", "size", "focal px", "faces", "mesh covers", "points off", "exposure")
    table = Table(*columns, box=None, padding=(0, 2, 0, 0))
    for view in check.views:
        off = "-" if view.reprojection is None else f"{view.reprojection:.2f} px"
        exposure = "-" if view.exposure is None else f"{view.exposure:.2f}"
        table.add_row(
            view.name, f"{view.width}x{view.height}", f"{view.focal_length:.0f}", str(view.faces),
            f"{100 * view.mesh_share:.0f} %", off, exposure,
        )  # fmt: skip
    console.print(table)
    faces = check.faces
    lines = [
        f"mesh: {len(scene.mesh.vertices)} vertices, {check.n_faces} faces; "
        f"{check.faces_in_part} faces are seen by at least 3 photos"
    ]
    for reason, ids in faces.without_part().items():
        lines.append(f"faces that take no part, {reason}: {len(ids)} ({listed(ids.tolist())})")
    if check.views_per_face:
        lines.append("photos a face: " + _spread(check.views_per_face, "{:.0f}"))
    if check.footprint:
        lines.append("size of a face in the photos, px: " + _spread(check.footprint, "{:.0f}"))
    if check.texture:
        lines.append(
            f"texture, grey levels a pixel: {_spread(check.texture, '{:.1f}')}; {int(faces.is_blank.sum())} faces are "
            f"blank, {int(faces.is_striped.sum())} striped"
        )
    for name, is_so in (("blank", faces.is_blank), ("striped", faces.is_striped)):
        if is_so.any():
            lines.append(f"{name} faces: {listed(np.flatnonzero(is_so).tolist())}")
    if check.parallax is not None:
        lines.append(f"lines of sight to a face spread over {check.parallax:.0f} degrees (median)")
    lines.append("pairs of face and photo: " + ", ".join(f"{name} {n}" for name, n in check.reasons.items()))
    lines.append(f"memory of a run: about {check.memory / 1e9:.1f} GB")
    lines += [f"note: {warning}" for warning in check.warnings]
    lines += [f"hint: {hint}" for hint in check.hints]
    lines += [f"to know: {suggestion}" for suggestion in check.suggestions]
    verdict, meaning = VERDICTS[check.verdict]
    for line in [*lines, f"verdict: {verdict.lower()}: {meaning[0].lower()}{meaning[1:-1]}"]:
        console.print(line, highlight=False, soft_wrap=True, markup=False)


def _spread(percentiles: tuple[float, ...], form: str) -> str:
    low, _, middle, _, high = (form.format(value) for value in percentiles)
    return f"{low} to {high}, median {middle}"
