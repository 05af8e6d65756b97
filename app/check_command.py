"""`check`: the findings as a page of text, and the mesh drawn over every photo."""

from pathlib import Path

from PIL import Image
from rich.console import Console
from rich.table import Table

from app.headless import load_with_progress, write_json
from app.scene_source import SceneSource
from fairing.io import prepare_output_folder, write_atomically
from fairing.scene import Scene
from fairing.scene_check import SceneCheck, check_scene, overlay

VERDICTS = {
    "good": "good: this input can be faired",
    "doubtful": "doubtful: it can be tried; see the hints",
    "unusable": "unusable: no face is seen by three photos",
}


def check_to_console(source: SceneSource, out: Path | None, console: Console) -> int:
    """Print the findings; with `out`, write `check.json` and overlays, too.

    Returns:
        Exit code: 1 if the input cannot be used.
    """
    scene = load_with_progress(source, console)
    check, reasons = check_scene(scene)
    _print(scene, check, console)
    if out is not None:
        prepare_output_folder(out)
        write_json(out / "check.json", check.as_dict())
        for v, view in enumerate(scene.views):
            image = Image.fromarray(overlay(scene, v, reasons))
            name = f"overlay-{view.name.replace('/', '_')}.png"
            write_atomically(out / name, lambda file, image=image: image.save(file, format="PNG"))
        console.print(f"wrote check.json and {len(scene.views)} overlays to {out}", highlight=False, soft_wrap=True)
    return 1 if check.verdict == "unusable" else 0


def _print(scene: Scene, check: SceneCheck, console: Console) -> None:
    table = Table("photo", "size", "focal px", "faces", "mesh covers", "points off", box=None, padding=(0, 2, 0, 0))
    for view in check.views:
        off = "-" if view.reprojection is None else f"{view.reprojection:.2f} px"
        table.add_row(
            view.name, f"{view.width}x{view.height}", f"{view.focal_length:.0f}", str(view.faces),
            f"{100 * view.mesh_share:.0f} %", off,
        )  # fmt: skip
    console.print(table)
    lines = [
        f"mesh: {len(scene.mesh.vertices)} vertices, {check.n_faces} faces; "
        f"{check.faces_in_part} faces are seen by at least 3 photos"
    ]
    if check.views_per_face:
        lines.append("photos a face: " + _spread(check.views_per_face, "{:.0f}"))
    if check.footprint:
        lines.append("size of a face in the photos, px: " + _spread(check.footprint, "{:.0f}"))
    if check.parallax is not None:
        lines.append(f"lines of sight to a face spread over {check.parallax:.0f} degrees (median)")
    lines.append("pairs of face and photo: " + ", ".join(f"{name} {n}" for name, n in check.reasons.items()))
    lines += [f"note: {warning}" for warning in check.warnings]
    lines += [f"hint: {hint}" for hint in check.hints]
    for line in [*lines, f"verdict: {VERDICTS[check.verdict]}"]:
        console.print(line, highlight=False, soft_wrap=True, markup=False)


def _spread(percentiles: tuple[float, ...], form: str) -> str:
    low, _, middle, _, high = (form.format(value) for value in percentiles)
    return f"{low} to {high}, median {middle}"
