"""Optional results of `fair`: textured models before and after, and the prediction of left-out photos."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from app.cli.lines import print_line
from app.cli.progress_bar import progress_bar
from app.cli.texture import DEFAULT_TEXTURE, paint_with_progress
from app.files.run_files import LEFT_OUT, MODEL, MODEL_BEFORE
from app.pictures.left_out_sheet import LeftOutSheet
from fairing.errors import InputError
from fairing.io import read_mesh, write_atomically
from fairing.io.textured_mesh import write_textured
from fairing.judge.left_out import judged_views, leave_one_out, left_out_summary
from fairing.mesh import Mesh
from fairing.scene import Scene


@dataclass(frozen=True)
class RunExtras:
    """What `fair` writes besides mesh, report and trace.

    Attributes:
        textured: Write model.glb, the mesh with a texture from the photos.
        textured_before: Write model_before.glb, the start mesh with a texture from the photos.
        left_out: Predict each photo from the others, before and after: PSNR and SSIM in report.json, and left_out.png.
        beside: With --left-out: another mesh, such as another run's mesh.ply. All are compared on the pixels that each covers.
    """

    textured: bool = False
    textured_before: bool = False
    left_out: bool = False
    beside: Path | None = None

    @property
    def any(self) -> bool:
        return self.textured or self.textured_before or self.left_out

    def other_mesh(self) -> Mesh | None:
        """The mesh `beside`.

        Raises:
            InputError: it cannot be read, or --left-out is missing.
        """
        if self.beside is None:
            return None
        if not self.left_out:
            raise InputError("option beside: expected --left-out with it; add --left-out")
        return Mesh(*read_mesh(self.beside))


def write_models(
    scene: Scene, start: np.ndarray, end: np.ndarray, extras: RunExtras, out: Path, console: Console
) -> None:
    """Write the requested textured models, for vertices (n, 3) float, world units, at the start and the end of the run."""
    wanted = [(extras.textured, MODEL, end), (extras.textured_before, MODEL_BEFORE, start)]
    for is_wanted, name, vertices in wanted:
        if is_wanted:
            write_textured(out / name, paint_with_progress(scene, vertices, DEFAULT_TEXTURE, console))
            print_line(console, f"wrote {out / name}")


def predict_left_out(
    scene: Scene, start: np.ndarray, end: np.ndarray, beside: Mesh | None, out: Path, console: Console
) -> dict[str, Any]:
    """Predict each photo from the others with both meshes. Writes left_out.png and returns the figures.

    Args:
        beside: another mesh; all meshes are judged on the pixels that every one of them covers.
    """
    views, sheet = judged_views(scene), LeftOutSheet(scene)
    with progress_bar(console) as bar:
        task = bar.add_task("predicting left-out photos", total=len(views))

        def on_view(prediction: Any) -> None:
            sheet.add(prediction)
            bar.advance(task)

        others = [] if beside is None else [beside]
        before, after, *of_others = leave_one_out(scene, start, end, *others, views=views, on_view=on_view)
    picture = sheet.picture(before, after)
    write_atomically(out / LEFT_OUT, lambda file: picture.save(file, format="PNG"))
    summary = left_out_summary(scene, before, after, *of_others)
    if summary["photos_judged"]:
        print_line(
            console,
            f"left-out photos: PSNR {summary['psnr_before']:.2f} -> {summary['psnr_after']:.2f} dB, "
            f"SSIM {summary['ssim_before']:.4f} -> {summary['ssim_after']:.4f} (mean of {summary['photos_judged']}, "
            f"{summary['photos_better']} better; {summary['judged_share']:.0%} of their pixels); wrote {out / LEFT_OUT}",
        )
    if "psnr_beside" in summary:
        print_line(
            console,
            f"the other mesh on the same pixels: PSNR {summary['psnr_beside']:.2f} dB, SSIM {summary['ssim_beside']:.4f}; "
            f"{summary['photos_better_than_beside']} photos are better than with it",
        )
    return summary
