"""`check`: findings about a scene on the terminal, and as a page with the mesh drawn over every photo."""

from contextlib import nullcontext
from pathlib import Path
from urllib.parse import quote

import numpy as np
from PIL import Image
from rich.console import Console
from rich.table import Table

from app.cli.arguments import (
    ALL_PHOTOS,
    AroundArgument,
    BoxArgument,
    CamerasArgument,
    MeshArgument,
    PhotosArgument,
    PointsArgument,
    SceneArgument,
)
from app.cli.lines import note_outside_photos, print_line
from app.cli.loading import load_with_points
from app.cli.photos_alone import with_cameras
from app.files.check_page import VERDICTS, check_page
from app.files.json_file import write_json
from app.files.scene_source import SceneSource
from app.pictures.check_pictures import THUMBNAIL, contact_sheet, overlay
from fairing.check.result import SceneCheck
from fairing.check.scene_check import check_scene
from fairing.io import locked_output_folder, write_atomically
from fairing.io.capture import listed
from fairing.judge.left_out import memory_of_left_out
from fairing.scene import Scene

PAGE, DATA, SHEET = "check.html", "check.json", "contact-sheet.png"


def check(
    scene: SceneArgument,
    mesh: MeshArgument = None,
    out: Path | None = None,
    points: PointsArgument = "automatic",
    photos: PhotosArgument = ALL_PHOTOS,
    cameras: CamerasArgument = "automatic",
    around: AroundArgument = "automatic",
    box: BoxArgument = None,
) -> int:
    """Check whether a scene can be refined: cameras, coverage, sizes, and what to do.

    Args:
        out: Folder for check.html, check.json and the mesh drawn over every photo.
    """
    return check_to_console(SceneSource.typed(scene, mesh, photos, points, cameras, around, box), out, Console())


def check_to_console(source: SceneSource, out: Path | None, console: Console) -> int:
    """Print the findings. With `out`, also write them as a page, as JSON and as pictures.

    Returns:
        Exit code: 1 if the input cannot be used.
    """
    with nullcontext() if out is None else locked_output_folder(out):
        source = with_cameras(source, Console(stderr=True))
        scene = load_with_points(source, console)
        findings = check_scene(scene)
        _print(scene, findings, console)
        if out is not None:
            note_outside_photos(console, source.scene, scene.views)
            _write(scene, findings, out)
            print_line(console, f"wrote {out / PAGE}, {DATA}, {SHEET} and {len(scene.views)} overlays")
    return 1 if findings.verdict == "unusable" else 0


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
    columns = ("photo", "size", "focal px", "faces", "mesh covers", "reprojection", "correction", "exposure")
    table = Table(*columns, box=None, padding=(0, 2, 0, 0))
    for view in check.views:
        off = "-" if view.reprojection is None else f"{view.reprojection:.2f} px"
        correction = "-" if view.correction is None else f"{view.correction:.2f} px"
        exposure = "-" if view.exposure is None else f"{view.exposure:.2f}"
        table.add_row(
            view.name, f"{view.width}x{view.height}", f"{view.focal_length:.0f}", str(view.faces),
            f"{100 * view.mesh_share:.0f} %", off, correction, exposure,
        )  # fmt: skip
    console.print(table)
    faces = check.faces
    lines = [
        f"mesh: {len(scene.mesh.vertices)} vertices, {check.n_faces} faces; "
        f"{check.faces_in_part} faces are seen by at least 3 photos"
    ]
    for reason, ids in faces.without_part().items():
        lines.append(f"faces without enough photos, {reason}: {len(ids)} ({listed(ids.tolist())})")
    if check.views_per_face:
        lines.append("photos per face: " + _spread(check.views_per_face, "{:.0f}"))
    if check.footprint:
        lines.append("size of a face in the photos, px: " + _spread(check.footprint, "{:.0f}"))
    if check.texture:
        lines.append(
            f"texture, grey levels per pixel: {_spread(check.texture, '{:.1f}')}; {int(faces.is_blank.sum())} faces are "
            f"blank, {int(faces.is_striped.sum())} striped"
        )
    for name, mask in (("blank", faces.is_blank), ("striped", faces.is_striped)):
        if mask.any():
            lines.append(f"{name} faces: {listed(np.flatnonzero(mask).tolist())}")
    if check.parallax is not None:
        lines.append(f"angle between the lines of sight to a face: {check.parallax:.0f} degrees (median)")
    lines.append("pairs of face and photo: " + ", ".join(f"{name} {n}" for name, n in check.reasons.items()))
    if check.placement.verdict != "elsewhere":  # then a hint says so
        lines.append(f"place of the mesh: {check.placement.line}")
    if check.cameras is not None:
        lines.append(f"cameras: {check.cameras.line.removeprefix('cameras ')}")
    left_out = max(check.memory, memory_of_left_out(scene))
    lines.append(f"memory of a run: about {check.memory / 1e9:.1f} GB; with --left-out {left_out / 1e9:.1f} GB")
    lines += [f"note: {warning}" for warning in check.warnings]
    lines += [f"hint: {hint}" for hint in check.hints]
    lines += [f"suggestion: {suggestion}" for suggestion in check.suggestions]
    verdict, meaning = VERDICTS[check.verdict]
    for line in [*lines, f"verdict: {verdict.lower()}: {meaning[0].lower()}{meaning[1:-1]}"]:
        print_line(console, line)


def _spread(percentiles: tuple[float, ...], form: str) -> str:
    low, _, middle, _, high = (form.format(value) for value in percentiles)
    return f"{low} to {high}, median {middle}"
