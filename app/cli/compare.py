"""`compare`: meshes of any origin side by side, judged by the same photos."""

from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console

from app.cli.arguments import ALL_PHOTOS, PhotosArgument, PointsArgument, SceneArgument
from app.cli.lines import note_outside_photos, print_line
from app.cli.loading import load_with_points
from app.cli.progress_bar import progress_bar
from app.export.comparison_page import PredictedPhotos, write_comparison
from app.files.json_file import write_json
from app.files.mesh_series import read_meshes, source_of_meshes
from fairing.errors import InputError
from fairing.judge.mesh_comparison import compare_meshes

PAGE, FIGURES = ".html", ".json"


def compare(
    scene: SceneArgument,
    meshes: Annotated[
        tuple[Path, ...],
        tyro.conf.Positional,
        tyro.conf.arg(metavar="MESH MESH ...", help="Mesh files, of any connectivity, in the frame of the scene."),
    ],
    out: Path,
    reference: Path | None = None,
    points: PointsArgument = "given",
    photos: PhotosArgument = ALL_PHOTOS,
) -> int:
    """Compare meshes of any origin by the same photos, points and pixels, in one page.

    Args:
        out: The page (.html); the figures go beside it (.json).
        reference: A mesh that is the truth, or nearer to it: distances to it are measured.
    """
    console = Console(stderr=True)
    if out.suffix.lower() != PAGE:
        raise InputError(f"--out {out}: expected a file ending in {PAGE}")
    if not out.parent.is_dir():
        raise InputError(f"--out {out}: there is no folder {out.parent}; create it first")
    surfaces = read_meshes(meshes)
    truth = None if reference is None else read_meshes([reference])[0]
    names = _names(meshes)
    loaded = load_with_points(source_of_meshes(scene, meshes[0], photos, points), console)
    note_outside_photos(console, scene, loaded.views)
    predicted = PredictedPhotos()
    with progress_bar(console) as bar:
        task = bar.add_task("comparing", total=2.0)
        figures = compare_meshes(
            loaded,
            surfaces,
            truth,
            lambda part, line: bar.update(task, completed=part, description=line),
            predicted.add,
        )
        write_comparison(
            names, figures, predicted, out, lambda part: bar.update(task, completed=1 + part, description="pictures")
        )
    summaries = [each.summary() for each in figures]
    write_json(out.with_suffix(FIGURES), {"scene": loaded.name, "meshes": dict(zip(names, summaries, strict=True))})
    for name, figure in zip(names, summaries, strict=True):
        psnr = "" if figure["psnr"] is None else f", left-out photos {figure['psnr']:.2f} dB"
        print_line(console, f"{name}: residual {figure['residual']:.4g} grey levels{psnr}")
    print_line(console, f"wrote {out} and {out.with_suffix(FIGURES).name}")
    return 0


def _names(files: tuple[Path, ...]) -> list[str]:
    """Names of the meshes: of the files, with their folders where these differ alone."""
    names = [file.name for file in files]
    return names if len(set(names)) == len(names) else [str(file) for file in files]
